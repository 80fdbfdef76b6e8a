function test_first_steps(recordings)
% The code of docs/interfaces/matlab.md runs in a folder that has a configuration.
folder = tempname;
mkdir(folder);
copyfile(fullfile(recordings, 'best.toml'), fullfile(folder, 'config.toml'));
previous = cd(folder);
restore = onCleanup(@() cd(previous));
first_steps;
assert(tick == 399 && all(isfinite(command)));
end
