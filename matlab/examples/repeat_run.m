function [commands, recorded] = repeat_run(folder)
% REPEAT_RUN  A loop with references and marker positions of a run of `tautscope demo`; it prints how the commands compare.
%
% In use, the reference comes from the operator's device, the marker positions from your detector, and the command goes to the
% drives. Commands are those of the run with profile paper. Profile best also uses how certain each detected position is, which
% is not in the table: its commands differ by what that changes.
if nargin < 1
    folder = 'run';
end
addpath(fullfile(fileparts(mfilename('fullpath')), '..'));
trace = tautscope.read_table(fullfile(folder, 'trace.csv'));
frames = tautscope.read_table(fullfile(folder, 'frames.csv'));
references = [trace.reference_insertion trace.reference_rotation trace.reference_bending];
recorded = [trace.command_insertion trace.command_rotation trace.command_bending];
features = [frames.features_a_x frames.features_a_y frames.features_b_x frames.features_b_y];

loop = tautscope.Loop(fullfile(folder, 'config.toml'));
commands = zeros(size(recorded));
image = 1;
for tick = 1:numel(trace.time)
    commands(tick, :) = loop.step(references(tick, :), trace.time(tick));
    if image <= numel(frames.arrived_at) && frames.arrived_at(image) <= trace.time(tick)
        report = loop.on_features(features(image, :), frames.captured_at(image));
        image = image + 1;
    end
end
fprintf('%d ticks, %d images, last status %s\n', tick, image - 1, report.status);
fprintf('largest difference of a command: %g m, %g rad, %g rad\n', max(abs(commands - recorded)));
fprintf('width of the slack: %.4f m, %.3f rad, %.3f rad\n', report.delta_plus - report.delta_minus);
if nargout == 0
    clear commands recorded  % or each of them would be printed
end
end
