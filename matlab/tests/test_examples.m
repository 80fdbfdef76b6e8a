function test_examples(folder)
% The examples read a run folder; repeating a run of profile paper gives its commands.
trace = tautscope.read_table(fullfile(folder, 'trace.csv'));
frames = tautscope.read_table(fullfile(folder, 'frames.csv'));
assert(all(abs(diff(trace.time) - 0.005) < 1e-9) && trace.time(1) == 0);
assert(isnan(trace.estimate_bending(1)) && ~isnan(trace.estimate_bending(end)));
assert(iscellstr(frames.status) && any(strcmp(frames.status, 'ok')));
assert(all(frames.observable_bending(strcmp(frames.status, 'ok')) == 1));
assert(all(frames.valid(strcmp(frames.status, 'no_markers')) == 0));
lines = strsplit(strtrim(fileread(fullfile(folder, 'trace.csv'))), char(10));
assert(numel(trace.time) == numel(lines) - 1);
[words, names] = deal(strsplit(strtrim(lines{end}), ','), fieldnames(trace));
for column = 1:numel(names) - 1
    assert(trace.(names{column})(end) == str2double(words{column}));
end

[commands, recorded] = repeat_run(folder);
assert(max(abs(commands(:) - recorded(:))) <= 1e-12);

file = fullfile(folder, 'hysteresis.png');
plot_hysteresis(folder);
assert(exist(file, 'file') == 2);
pixels = imread(file);
assert(size(pixels, 2) > 1000 && numel(unique(pixels)) > 10, 'the figure is empty');
end
