loop = tautscope.Loop(sprintf('[[dof]]\nname = "bend"\nwidth_limit = 1.2'));  % the largest slack that is compensated [rad]
moved = @(tip, command) min(max(tip, command - 0.5), command + 0.5);  % in use: your motor; here a slack of 1 rad
[tip, alone] = deal(0);
off = [0 0];
for tick = 0:3999                                    % in use: every control period
    time = tick * loop.period;
    reference = sin(1.57 * time);                    % in use: from the operator [rad]
    command = loop.step(reference, time);
    tip = moved(tip, command);
    alone = moved(alone, reference);
    off = off + abs([tip alone] - reference) / 400;
    if tick >= 1400 && mod(tick, 8) == 0             % in use: for every measurement of the tip
        report = loop.on_tip(tip, time);
    end
    if mod(tick, 400) == 399
        slack = 2 * loop.hysteresis().half_width;
        fprintf('%2.0f s: slack of %.2f rad, tip off by %.2f rad, without tautscope by %.2f rad\n', time, slack, off);
        off = [0 0];
    end
end
