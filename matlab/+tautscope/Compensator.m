classdef Compensator < handle
    % Compensator  The article's inverse of the plays of 1 to 8 axes, each by itself, Eqs. (2)-(3).
    %
    %   compensator = tautscope.Compensator(struct('free_gain', 5, 'gain_limit', 5, 'delta_minus', [-0.2 -0.3], 'delta_plus', [0.2 0.3]));
    %   command = compensator.step(reference);   % 1xn
    %
    % A value of the settings is one number for all axes, or 1xn; 'recovery' may be left out. Offsets are input minus output.

    properties (Access = private)
        serial
    end

    methods
        function self = Compensator(settings)
            if ~isfield(settings, 'recovery')
                settings.recovery = 0;
            end
            names = {'free_gain', 'gain_limit', 'recovery', 'delta_minus', 'delta_plus'};
            self.serial = tautscope_mex('compensator', tautscope.per_axis(settings, names));
        end

        function delete(self)
            tautscope_mex('destroy', self.serial);
        end

        function command = step(self, reference)
            % The command (1xn) for the next reference (n numbers); the first command is the reference.
            command = tautscope_mex('article', self.serial, reference, []);
        end

        function set_offsets(self, delta_minus, delta_plus)
            % Change the contact offsets (n numbers each); the command does not move.
            tautscope_mex('set_offsets', self.serial, delta_minus, delta_plus);
        end
    end
end
