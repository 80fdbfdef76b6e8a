function test_errors(folder)
% Bad input is an error that names the argument, and leaves the loop unchanged.
config = fullfile(folder, 'paper.toml');
expect('tautscope:Config', 'missing.toml', @() tautscope.Loop('missing.toml'));
wrong = [tempname '.toml'];
id = fopen(wrong, 'w');
fprintf(id, 'law.tip_gian = 3.0\n');
fclose(id);
remove = onCleanup(@() delete(wrong));
expect('tautscope:Config', 'law.tip_gian: unknown key', @() tautscope.Loop(wrong));

loop = tautscope.Loop(config);
assert(loop.period == 1e-3);
first = loop.step([0.025 0 0.9], 0);
expect('tautscope:Signal', 'reference', @() loop.step([NaN 0 0.9], 0.001));
expect('tautscope:Signal', 'reference: got 2 elements', @() loop.step([0 0], 0.001));
expect('tautscope:Signal', 'time: got 1 elements of class single', @() loop.step([0.025 0 0.9], single(1)));
expect('tautscope:Signal', 'time: got nothing', @() loop.step([0.025 0 0.9]));
expect('tautscope:Signal', 'expected loop.on_frame(image, captured_at)', @() loop.on_frame());
expect('tautscope:Signal', 'flag: got nothing', @() loop.raise_flag());
expect('tautscope:Signal', 'features', @() loop.on_features([1 2 3], 0));
expect('tautscope:Image', 'uint8', @() loop.on_frame(zeros(576, 720, 3), 0));
expect('tautscope:Image', 'got 57 x 72 px', @() loop.on_frame(zeros(72, 57, 3, 'uint8'), 0));
expect('tautscope:Signal', 'share', @() loop.set_compensation(2));
expect('tautscope:Signal', 'no_such_flag', @() loop.raise_flag('no_such_flag'));
assert(isequal(loop.step([0.025 0 0.9], 0.001), first));

loop.raise_flag('drive_fault');
state = loop.supervision();
assert(strcmp(state.reaction, 'quick_stop') && any(strcmp(state.flags, 'drive_fault')));
held = loop.step([0.03 0 0.9], 0.002);
assert(isequal(held, first));
loop.engage();
state = loop.supervision();
assert(strcmp(state.reaction, 'none') || strcmp(state.reaction, 'warn'));

bend = tautscope.Loop(sprintf('[[dof]]\nname = "bend"\nwidth_limit = 1.2'));
bend.step(0, 0);
for sensor = {1.5, -1, NaN, 1e10}
    expect('tautscope:Signal', 'sensor: got', @() bend.on_tip(0, 0, [], sensor{1}));
end
expect('tautscope:Signal', 'sensor: got 4', @() bend.on_tip(0, 0, [], 4));
expect('tautscope:Signal', 'point: got 1.5', @() bend.on_measurement(0, 0, 1, @(q) q, 0, 1.5));
assert(strcmp(bend.on_tip(0, 0, [], 1).status, 'ok'));

another = tautscope.Loop(config);
another.step([0.025 0 0.9], 0);
delete(another);
expect('tautscope:Signal', 'deleted', @() another.step([0.025 0 0.9], 0.001));
expect('tautscope:Signal', 'deleted', @() tautscope_mex('period', 'no number'));
loop.step([0.025 0 0.9], 0.003);
clear tautscope_mex  % a loop outlives this
loop.step([0.025 0 0.9], 0.004);
for i = 1:200  % more loops than can exist at once: each is destroyed
    passing = tautscope.Loop(config);
    delete(passing);
end
end
