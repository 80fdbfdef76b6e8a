function table = read_table(file)
% READ_TABLE  Columns of a CSV file of a run folder, such as trace.csv and frames.csv, as fields of a structure.
%
% Numbers are columns of class double, NaN if not known; words such as status are cells of text; True and False are 1 and 0.
% In MATLAB readtable(file) reads it as well; Octave has no readtable.
[id, problem] = fopen(file, 'r');
if id < 0
    error('tautscope:Config', 'File cannot be read: %s: %s', file, problem);
end
close_file = onCleanup(@() fclose(id));
names = strsplit(strtrim(fgetl(id)), ',');
rows = textscan(id, repmat('%s', 1, numel(names)), 'Delimiter', ',');
for column = 1:numel(names)
    words = rows{column};
    values = str2double(words);
    is_number = ~isnan(values) | strcmpi(words, 'nan');
    if all(is_number)
        table.(names{column}) = values;
    elseif all(ismember(words, {'True', 'False'}))
        table.(names{column}) = double(strcmp(words, 'True'));
    else
        table.(names{column}) = words;
    end
end
end
