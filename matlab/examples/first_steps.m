loop = tautscope.Loop('config.toml');
for tick = 0:399                                     % in use: every control period
    time = tick * loop.period;
    reference = [0.025 + 0.01 * time, 0, 0.9];       % m, rad, rad
    command = loop.step(reference, time);            % in use: to the drives
    if mod(tick, 40) == 0                            % in use: for every image
        features = [350 260 345 190];                % u, v of band A, of band B in px
        report = loop.on_features(features, time);   % or loop.on_frame(image, captured_at)
        fprintf('%.2f s: insertion %.4f m, %s, %s\n', time, command(1), report.status, report.reaction);
        if any(strcmp(report.reaction, {'quick_stop', 'disable'}))
            break                                    % in use: stop the drives
        end
    end
end
