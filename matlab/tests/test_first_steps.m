function test_first_steps()
% The code of docs/interfaces/matlab.md finds the slack of 1 rad.
first_steps;
assert(abs(slack - 1) < 0.1 && all(isfinite(command)));
end
