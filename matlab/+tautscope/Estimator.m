classdef Estimator < handle
    % Estimator  The article's estimation of the contact offsets of 1 to 8 axes, each by itself, Eqs. (4)-(6).
    %
    %   estimator = tautscope.Estimator(struct('update_distance', 0.02, 'contact_tolerance', 0.4, 'smoothing_factor', 0.25, ...
    %                                          'delta_minus', [0 0], 'delta_plus', [0 0]));
    %   [delta_minus, delta_plus] = estimator.update(command, measured);   % 1xn
    %
    % A value of the settings is one number for all axes, or 1xn. Offsets are input minus output.

    properties (Access = private)
        serial
    end

    methods
        function self = Estimator(settings)
            names = {'update_distance', 'contact_tolerance', 'smoothing_factor', 'delta_minus', 'delta_plus'};
            self.serial = tautscope_mex('estimator', tautscope.per_axis(settings, names));
        end

        function delete(self)
            tautscope_mex('destroy', self.serial);
        end

        function [delta_minus, delta_plus] = update(self, command, measured)
            % The offsets (1xn) after a command and the output measured at the same instant (n numbers each; NaN: not measured).
            [delta_minus, delta_plus] = tautscope_mex('article', self.serial, command, measured);
        end
    end
end
