function recording = read_recording(name)
% READ_RECORDING  Rows of a recording that examples/cpp/record.py has written; `name` is its path without extension.
recording.config = [name '.toml'];
recording.ticks = read_rows([name '.ticks'], 9);     % time, made_at, reference (3), event; command (3)
recording.images = read_rows([name '.images'], 23);  % tick, captured_at, features (4); status, reaction, flags, estimates, ...
end

function rows = read_rows(file, columns)
[id, problem] = fopen(file, 'r', 'ieee-le');
assert(id >= 0, '%s: %s', file, problem);
rows = fread(id, [columns Inf], 'double')';
fclose(id);
end
