function values = per_axis(settings, names)
% PER_AXIS  A column of the named settings for each axis; a setting of one number is that of all axes.
missing = names(~isfield(settings, names));
unknown = setdiff(fieldnames(settings), names);
if ~isempty(missing) || ~isempty(unknown)
    error('tautscope:Config', 'settings: got %s, expected %s', strjoin(fieldnames(settings)', ', '), strjoin(names, ', '));
end
counts = cellfun(@(name) numel(settings.(name)), names);
values = zeros(numel(names), max(counts));
for row = 1:numel(names)
    if ~any(counts(row) == [1 max(counts)])
        error('tautscope:Config', '%s: got %d numbers, expected 1 or %d', names{row}, counts(row), max(counts));
    end
    values(row, :) = settings.(names{row})(:)';
end
end
