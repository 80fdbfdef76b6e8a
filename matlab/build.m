function build()
% BUILD  Compile the gateway of tautscope.Loop, and the S-function where Simulink is installed.
%
% First run `cargo build --package tautscope-ffi --release` in the repository. A C compiler is needed: `mex -setup` in MATLAB,
% the Debian package octave-dev for Octave. The library is linked statically: the compiled files need nothing else.
here = fileparts(mfilename('fullpath'));
library = fullfile(here, '..', 'target', 'release', 'libtautscope.a');
if ~exist(library, 'file')
    error('tautscope:Config', 'File not found: %s. First run: cargo build --package tautscope-ffi --release', library);
end
include = ['-I' fullfile(here, '..', 'crates', 'ffi', 'include')];
is_octave = exist('OCTAVE_VERSION', 'builtin') > 0;
sources = {'tautscope_mex.c'};
if ~is_octave && license('test', 'SIMULINK')
    sources{end + 1} = 'sfun_tautscope.c';
end
previous = cd(here);
restore = onCleanup(@() cd(previous));
for source = sources
    mex(source{1}, include, ['-I' fullfile(here, '..', 'fmi')], library, '-lpthread', '-ldl', '-lm');
end
end
