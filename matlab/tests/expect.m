function expect(identifier, words, action)
% EXPECT  Fail unless an action ends with this error.
try
    action();
catch problem
    assert(strcmp(problem.identifier, identifier), '%s: %s', problem.identifier, problem.message);
    assert(~isempty(strfind(problem.message, words)), problem.message); %#ok<STREMP>
    return
end
error('no error, expected %s: %s', identifier, words);
end
