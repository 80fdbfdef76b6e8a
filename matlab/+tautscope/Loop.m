classdef Loop < handle
    % Loop  Image-based hysteresis compensation: references in, commands out, images update the estimate.
    %
    %   loop = tautscope.Loop('config.toml');
    %   command = loop.step(reference, time);               % in every control period
    %   report = loop.on_features(features, captured_at);   % for every image
    %
    % The file has every key of the configuration, as `tautscope config` prints it; its key `profile` selects the profile.
    % References and commands are [insertion, rotation, bending] in m, rad, rad. Times are s on one clock of yours. Pixels count
    % from 0 at the centre of the first one: subtract 1 from positions that MATLAB gives.
    %
    % Errors have the identifiers tautscope:Config, tautscope:Signal and tautscope:Image, and leave the loop unchanged.

    properties (SetAccess = private)
        period  % Control period of the configuration [s].
    end

    properties (Access = private)
        toml
        serial = 0
    end

    methods
        function self = Loop(file)
            [id, problem] = fopen(file, 'r');
            if id < 0
                error('tautscope:Config', 'File cannot be read: %s: %s', file, problem);
            end
            self.toml = fread(id, Inf, '*uint8');
            fclose(id);
            self.serial = tautscope_mex('create', self.toml);
            self.period = tautscope_mex('period', self.serial);
        end

        function delete(self)
            tautscope_mex('destroy', self.serial);
        end

        function command = step(self, reference, time, made_at)
            % One control tick: the command (1x3) for a reference (3 numbers), Eqs. (2)-(3).
            %
            % made_at is when the reference was made [s], if known: a reference that is too old stops the motion.
            if nargin < 4
                made_at = NaN;
            end
            command = tautscope_mex('step', self.serial, reference, time, made_at);
        end

        function report = on_features(self, features, captured_at)
            % Image update with u, v of band A, u, v of band B [px]; NaN NaN for a band that was not found.
            %
            % captured_at is the time of capture [s]. The report has status, reaction, flags, state_estimate, delta_minus,
            % delta_plus, innovation, ...; values that are not known are NaN.
            report = tautscope_mex('on_features', self.serial, features, captured_at);
        end

        function report = on_frame(self, image, captured_at)
            % Image update with an image as imread gives it: height x width x 3 of class uint8, R, G, B.
            %
            % It takes some ms, in which the loop cannot step.
            report = tautscope_mex('on_frame', self.serial, self.toml, image, captured_at);
        end

        function state = supervision(self)
            % The reaction in force, the active and latched flags, and the share of the compensation in use.
            %
            % The loop cannot stop drives: at the reactions quick_stop and disable your program must.
            state = tautscope_mex('supervision', self.serial);
        end

        function engage(self)
            % Resume held motion, without a jump of the command.
            tautscope_mex('engage', self.serial);
        end

        function acknowledge(self)
            % Acknowledge the warnings; nothing else changes.
            tautscope_mex('acknowledge', self.serial);
        end

        function set_compensation(self, share)
            % Use a share of the compensation: all with 1, none with 0.
            tautscope_mex('set_compensation', self.serial, share);
        end

        function raise_flag(self, flag)
            % Report a condition that only the rig can detect: 'drive_fault' stops the motion until engage.
            tautscope_mex('raise_flag', self.serial, flag);
        end
    end
end
