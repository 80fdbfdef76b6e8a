function test_same_as_python(folder)
% The class gives the commands, states and offsets that Python gave: 60 s at 1 kHz of each profile, and 2 s of images.
for profile = {'paper', 'best'}
    repeat(fullfile(folder, profile{1}));
end
repeat_images(fullfile(folder, 'frames'));
end

function repeat(name)
recording = read_recording(name);
ticks = recording.ticks;
loop = tautscope.Loop(recording.config);
commands = zeros(size(ticks, 1), 3);
image = 1;
images = recording.images;
estimates = zeros(size(images, 1), 9);
statuses = cell(size(images, 1), 1);
begin = tic;
for tick = 1:size(ticks, 1)
    switch ticks(tick, 6)
        case 1
            loop.engage();
        case 2
            loop.acknowledge();
        case 3
            loop.raise_flag('drive_fault');
        case 4
            loop.set_compensation(0.5);
        case 5
            loop.set_compensation(1);
    end
    commands(tick, :) = loop.step(ticks(tick, 3:5), ticks(tick, 1), ticks(tick, 2));
    while image <= size(images, 1) && images(image, 1) == tick - 1
        report = loop.on_features(images(image, 3:6), images(image, 2));
        estimates(image, :) = [report.state_estimate report.delta_minus report.delta_plus];
        statuses{image} = report.status;
        image = image + 1;
    end
end
duration = toc(begin);
assert(image == size(images, 1) + 1);
names = {'ok', 'held', 'partial', 'no_markers', 'stale', 'duplicate', 'refused'};
assert(isequal(statuses, names(images(:, 7) + 1)'));
compare(name, 'commands', commands, ticks(:, 7:9));
compare(name, 'estimates', estimates, images(:, 10:18));
fprintf('%d ticks and %d image updates in %.1f s, %.0f us per tick\n', numel(commands) / 3, image - 1, duration, ...
        1e6 * duration / size(commands, 1));
end

function repeat_images(name)
recording = read_recording(name);
loop = tautscope.Loop(recording.config);
[height, width] = deal(576, 720);
id = fopen([name '.pixels']);
images = recording.images;
commands = zeros(size(recording.ticks, 1), 3);
estimates = zeros(size(images, 1), 9);
image = 1;
for tick = 1:size(commands, 1)
    commands(tick, :) = loop.step(recording.ticks(tick, 3:5), recording.ticks(tick, 1));
    while image <= size(images, 1) && images(image, 1) == tick - 1
        rows = fread(id, [3 * width, height], '*uint8');             % blue, green, red per pixel
        pixels = permute(reshape(rows, 3, width, height), [3 2 1]);
        report = loop.on_frame(pixels(:, :, [3 2 1]), images(image, 2));
        estimates(image, :) = [report.state_estimate report.delta_minus report.delta_plus];
        image = image + 1;
    end
end
fclose(id);
compare(name, 'commands', commands, recording.ticks(:, 7:9));
compare(name, 'estimates', estimates, images(:, 10:18));
end

function compare(name, what, values, expected)
is_same = isequal(typecast(values(:), 'uint64'), typecast(expected(:), 'uint64'));
[~, recording] = fileparts(name);
fprintf('%s: %s: %d numbers, largest difference %g, same bits: %d\n', recording, what, numel(values), ...
        max(abs(values(:) - expected(:))), is_same);
assert(isequal(isnan(values), isnan(expected)));
assert(is_same || max(abs(values(:) - expected(:))) <= 1e-12);
end
