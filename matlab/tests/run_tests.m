function run_tests(recordings, run)
% RUN_TESTS  Test the class with recordings of examples/cpp/record.py, and the examples with a run folder of write_run.py.
here = fileparts(mfilename('fullpath'));
addpath(here, fullfile(here, '..'), fullfile(here, '..', 'examples'));
if exist('OCTAVE_VERSION', 'builtin')
    warning('off', 'Octave:gnuplot-graphics');
end
tests = {@() test_same_as_python(recordings), @() test_errors(recordings), @() test_examples(run), @() test_axes(), @() test_first_steps()};
for i = 1:numel(tests)
    fprintf('== %s\n', func2str(tests{i}));
    tests{i}();
end
end
