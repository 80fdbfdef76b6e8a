function plot_hysteresis(folder)
% PLOT_HYSTERESIS  Tip over reference of a run of `tautscope demo`, without and with compensation, as a figure and a PNG file.
if nargin < 1
    folder = 'run';
end
addpath(fullfile(fileparts(mfilename('fullpath')), '..'));
without = tautscope.read_table(fullfile(folder, 'trace_uncompensated.csv'));
with = tautscope.read_table(fullfile(folder, 'trace.csv'));
names = {'insertion', 'rotation', 'bending'};
factors = [1e3, 180 / pi, 180 / pi];
units = {'mm', 'deg', 'deg'};
figure('visible', 'off', 'paperunits', 'inches', 'paperposition', [0 0 10 3.6]);
for dof = 1:3
    axes('position', [0.07 + 0.32 * (dof - 1), 0.15, 0.24, 0.75]); %#ok<LAXES>
    column = ['reference_' names{dof}];
    tip = ['true_' names{dof}];
    plot(factors(dof) * without.(column), factors(dof) * without.(tip), 'color', [0.6 0.6 0.6]);
    hold on;
    plot(factors(dof) * with.(column), factors(dof) * with.(tip), 'color', [0 0.45 0.7]);
    xlabel(sprintf('reference (%s)', units{dof}));
    ylabel(sprintf('tip (%s)', units{dof}));
    title(names{dof});
    if dof == 1
        legend({'uncompensated', 'compensated'}, 'location', 'northwest', 'fontsize', 8);
    end
end
file = fullfile(folder, 'hysteresis.png');
print(file, '-dpng', '-r150');
fprintf('%s\n', file);
end
