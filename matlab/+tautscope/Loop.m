classdef Loop < handle
    % Loop  Hysteresis compensation: references in, commands out, measurements of the tip update the estimate.
    %
    %   loop = tautscope.Loop(sprintf('[[dof]]\nname = "bend"\nwidth_limit = 1.2'));
    %   command = loop.step(reference, time);            % in every control period
    %   report = loop.on_tip(values, captured_at);       % whenever a sensor has measured the tip
    %
    % The configuration is the name of a file, or text of several lines, in which missing keys have their defaults. With [[dof]] it
    % has 1 to 8 degrees of freedom. Without, it is of the article's instrument:
    % on_features and on_frame take its images, and references and commands are [insertion, rotation, bending] in m, rad, rad.
    % Its key `profile` selects the profile. Times are s on one clock of yours. Pixels count from 0 at the centre of the first one:
    % subtract 1 from positions that MATLAB gives.
    %
    % Errors have the identifiers tautscope:Config, tautscope:Signal, tautscope:Size and tautscope:Image, and leave the loop unchanged.

    properties (SetAccess = private)
        period  % Control period of the configuration [s].
    end

    properties (Access = private)
        toml
        serial = 0
        problem = []  % the error of a model of the user's
    end

    methods
        function self = Loop(configuration)
            configuration = char(configuration);  % or a string of MATLAB
            if any(configuration == sprintf('\n'))
                self.toml = unicode2native(configuration, 'UTF-8');
            else
                [id, problem] = fopen(configuration, 'r');
                if id < 0
                    error('tautscope:Config', 'File cannot be read: %s: %s', configuration, problem);
                end
                self.toml = fread(id, Inf, '*uint8');
                fclose(id);
            end
            self.serial = tautscope_mex('create', self.toml);
            self.period = tautscope_mex('period', self.serial);
        end

        function delete(self)
            tautscope_mex('destroy', self.serial);
        end

        function command = step(self, reference, time, made_at)
            % One control tick: the command (1xn) for a reference (n numbers).
            %
            % made_at is when the reference was made [s], if known: a reference that is too old stops the motion.
            if nargin < 3  % `time` is a function of Octave, too
                error('tautscope:Signal', 'time: got nothing, expected loop.step(reference, time) with a time in s');
            end
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
            if nargin < 3  % `image` is a function, too
                error('tautscope:Signal', 'image, captured_at: expected loop.on_frame(image, captured_at)');
            end
            report = tautscope_mex('on_frame', self.serial, self.toml, image, captured_at);
        end

        function report = on_tip(self, values, captured_at, covariance, sensor)
            % Update with the tip measured degree by degree (n numbers); NaN for what was not measured.
            %
            % captured_at is the time of the measurement [s]. Without a covariance (nxn) measurement.tip_deviation is used. sensor is
            % 0 to 3: sensors with rates and delays of their own. The report has status, state_estimate, delta_minus, ...
            if nargin < 4
                covariance = [];
            end
            if nargin < 5
                sensor = 0;
            end
            report = tautscope_mex('on_measurement', self.serial, values, captured_at, covariance, sensor);
        end

        function report = on_measurement(self, values, captured_at, covariance, predict, sensor, point)
            % Update with up to 16 numbers (m) of the covariance (mxm): predict is a function handle from a state (1xn) to the m
            % numbers that the sensor would measure, [] where it sees nothing.
            %
            % point is 2 for u, v of points of an image, which are right or wrong together.
            if nargin < 6
                sensor = 0;
            end
            if nargin < 7
                point = 1;
            end
            self.problem = [];
            guarded = @(state) self.predicted(predict, state);
            report = tautscope_mex('on_measurement', self.serial, values, captured_at, covariance, sensor, guarded, point);
            if ~isempty(self.problem)
                rethrow(self.problem);
            end
        end

        function state = predicted_state(self)
            % The state of the tip (1xn) that the estimated slack predicts now.
            state = tautscope_mex('predicted_state', self.serial);
        end

        function found = hysteresis(self)
            % The hysteresis found so far: half_width, width_std, centre, gain, gain_std (1xn each).
            found = tautscope_mex('hysteresis', self.serial);
        end

        function state = supervision(self)
            % The reaction in force, the active and latched flags, and the share of the compensation that is allowed.
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
            if nargin < 2  % `flag` is a function, too
                error('tautscope:Signal', 'flag: got nothing, expected loop.raise_flag(name) with the name of a flag');
            end
            tautscope_mex('raise_flag', self.serial, flag);
        end
    end

    methods (Hidden)
        function values = predicted(self, predict, state)
            values = [];
            if isempty(self.problem)
                try
                    values = predict(state);
                catch problem
                    self.problem = problem;  % no error may jump over the library
                end
            end
        end
    end
end
