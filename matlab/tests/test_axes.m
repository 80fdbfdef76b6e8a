function test_axes()
% Loops with [[dof]]: on_tip and on_measurement find the width of a play; the article's axes do not influence each other.
text = sprintf('[[dof]]\nname = "a"\nwidth_limit = 1.2\n[[dof]]\nname = "b"\nwidth_limit = 1.2\n');
half = [0.2 0.3];
rows = [20 0.5; 0 1; 1 1];
for profile = {'best', 'paper'}
    by_tip = tautscope.Loop(sprintf('profile = "%s"\n%s', profile{1}, text));
    by_model = tautscope.Loop(sprintf('profile = "%s"\n%s', profile{1}, text));
    loops = {by_tip, by_model};
    tips = zeros(2, 2);
    for tick = 0:3999
        time = tick * by_tip.period;
        reference = [sin(2 * time) sin(1.3 * time)];
        for i = 1:2
            command = loops{i}.step(reference, time);
            tips(i, :) = min(max(tips(i, :), command - half), command + half);
        end
        if mod(tick, 8) == 0
            by_tip.on_tip(tips(1, :), time);
            report = by_model.on_measurement(tips(2, :) * rows', time, 1e-4 * eye(3), @(q) q * rows');
        end
    end
    for i = 1:2
        width = 2 * loops{i}.hysteresis().half_width;
        assert(all(abs(width - 2 * half) < 0.1), '%s: %s', profile{1}, mat2str(width));
        assert(all(abs(tips(i, :) - reference) < 0.15));
    end
    assert(numel(report.predicted_values) == 3 && numel(report.state_estimate) == 2);
    assert(all(abs(by_tip.predicted_state() - tips(1, :)) < 0.1));
end
expect('tautscope:Size', 'measurement.count', @() by_tip.on_tip(0, time));
expect('tautscope:Signal', 'expected 2', @() by_tip.step(0, time));
expect('tautscope:Signal', 'images', @() by_tip.on_features([1 2 3 4], time));
expect('tautscope:Signal', 'predict: got 1', @() by_model.on_measurement([0 0], time, eye(2), @(q) 0));
expect('of:model', 'of the model', @() by_model.on_measurement([0 0], time, eye(2), @(q) error('of:model', 'of the model')));
expect('tautscope:Config', 'widht', @() tautscope.Loop(sprintf('[[dof]]\nname = "a"\nwidth_limit = 1\nwidht = 1')));
assert(all(isfinite(by_model.step(reference, time + 0.005))));

gains = struct('free_gain', 5, 'gain_limit', 5, 'delta_minus', [0 0], 'delta_plus', 0);
own = struct('update_distance', [0.02 0.03], 'contact_tolerance', 0.4, 'smoothing_factor', 0.25, 'delta_minus', 0, 'delta_plus', 0);
both = tautscope.Compensator(gains);
found = tautscope.Estimator(own);
gains.delta_minus = 0;
own.update_distance = 0.03;
alone = tautscope.Compensator(gains);
of_second = tautscope.Estimator(own);
tip = [0 0];
for tick = 1:3000
    command = both.step([sin(0.01 * tick) sin(0.007 * tick)]);
    assert(alone.step(sin(0.007 * tick)) == command(2));
    tip = min(max(tip, command - half), command + half);
    [minus, plus] = found.update(command, tip);
    both.set_offsets(minus, plus);
    [minus_of_second, plus_of_second] = of_second.update(command(2), tip(2));
    alone.set_offsets(minus_of_second, plus_of_second);
end
assert(all(abs(plus - minus - 2 * half) < 0.05), mat2str(plus - minus));
expect('tautscope:Signal', 'reference: got 1', @() both.step(0));
expect('tautscope:Config', 'free_gain', @() tautscope.Compensator(setfield(gains, 'free_gain', 9))); %#ok<SFLD>
expect('tautscope:Config', 'update_distance', @() tautscope.Estimator(gains));
end
