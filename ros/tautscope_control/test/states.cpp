/* Operating states: what moves the command, what stops it, and when. */

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <string>

#include <tautscope_control/control_loop.hpp>

#include "expect.hpp"

using namespace tautscope_control;

namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr tautscope::Vector start{25e-3, 0.0, 0.9};

bool operator==(const Values &a, const Values &b) { return std::equal(a.begin(), a.end(), b.begin(), b.end()); }

/// A loop with its clock, and an operator who moves the insertion at 10 mm/s.
struct Rig {
    explicit Rig(const std::string &toml) : control(toml) {}

    /// Ticks without a word from the operator.
    Tick wait(double duration) {
        Tick result{};
        for (const double end = time + duration; time < end; time += control.period()) {
            if (!are_silent) {
                control.set_measured(drives, time);
            }
            result = control.step(time);
            control.exchange();
            drives = result.is_sent ? result.command : drives;
            const double step = std::abs(result.command[0] - last);
            largest_step = std::isfinite(step) ? std::max(largest_step, step) : largest_step;
            last_motion = step > 0 ? time : last_motion;
            last = result.command[0];
        }
        return result;
    }

    /// Ticks with a new reference each.
    Tick move(double duration, double speed = 10e-3) {
        Tick result{};
        for (const double end = time + duration; time < end;) {
            reference[0] += speed * control.period();
            control.set_reference(reference, time);
            result = wait(control.period() / 2);
        }
        return result;
    }

    ControlLoop control;
    tautscope::Vector reference = start;
    /// Where the drives are, and whether they do not tell it.
    Values drives{start};
    bool are_silent = false;
    double time = 100.0, last = nan, last_motion = nan, largest_step = 0.0;
};

void disabled_until_enabled(const std::string &toml) {
    Rig rig(toml);
    EXPECT(rig.control.status().state == OperatingState::disabled);
    Tick tick = rig.move(0.1);
    EXPECT(!tick.is_sent && tick.state == OperatingState::disabled);
    rig.control.post(Request::enable);
    tick = rig.wait(0.1);
    // Where the drives are, before the first reference.
    EXPECT(tick.is_sent && tick.command == Values(start) && tick.state == OperatingState::enabled);
    tick = rig.move(0.1);
    EXPECT(tick.is_sent && tick.command[0] > start[0]);
    rig.control.post(Request::disable);
    tick = rig.move(0.1);
    EXPECT(!tick.is_sent && tick.state == OperatingState::disabled);
}

void a_silent_device_stops_the_motion(const std::string &toml) {
    for (const double silence_at : {0.5, 0.503, 1.7}) {
        Rig rig(toml);
        rig.control.post(Request::enable);
        rig.move(silence_at);
        const double silent_since = rig.time;
        EXPECT(rig.last_motion > silent_since - 2 * rig.control.period());
        Tick tick = rig.wait(1.0);
        EXPECT(rig.last_motion <= silent_since + 0.1);
        EXPECT(tick.is_sent && tick.state == OperatingState::paused);
        EXPECT(rig.control.status().flags & (1U << TAUTSCOPE_FLAG_REFERENCE_LATE));
        // The device returns elsewhere: nothing moves before the operator resumes, and then from where the command is.
        rig.reference[0] += 20e-3;
        rig.last_motion = nan;
        tick = rig.move(0.5);
        EXPECT(std::isnan(rig.last_motion) && tick.state == OperatingState::paused);
        rig.largest_step = 0.0;
        rig.control.post(Request::resume);
        tick = rig.move(0.5);
        EXPECT(tick.state == OperatingState::enabled && rig.last_motion > rig.time - 2 * rig.control.period());
        EXPECT(rig.largest_step < 1e-3);
    }
}

void a_jump_stops_the_motion(const std::string &toml) {
    Rig rig(toml);
    rig.control.post(Request::enable);
    rig.move(0.5);
    rig.reference[0] += 20e-3;
    rig.largest_step = 0.0;
    const Tick tick = rig.move(0.2);
    EXPECT(tick.state == OperatingState::paused && rig.largest_step < 1e-3);
}

void a_pause_holds_until_resumed(const std::string &toml) {
    Rig rig(toml);
    rig.control.post(Request::enable);
    rig.move(0.5);
    rig.control.post(Request::pause);
    Tick tick = rig.wait(0.01);
    rig.last_motion = nan;
    rig.largest_step = 0.0;
    tick = rig.move(2.0);
    EXPECT(tick.is_sent && tick.state == OperatingState::paused && std::isnan(rig.last_motion));
    rig.control.post(Request::resume);
    tick = rig.move(1.0);
    EXPECT(tick.state == OperatingState::enabled && rig.last_motion > 0.0 && rig.largest_step < 1e-3);
    // What stops wins over what moves, in whichever order they were asked for.
    rig.control.post(Request::pause);
    rig.control.post(Request::resume);
    EXPECT(rig.wait(0.01).state == OperatingState::paused);
    rig.control.post(Request::disable);
    rig.control.post(Request::enable);
    EXPECT(rig.wait(0.01).state == OperatingState::disabled);
}

void a_drive_fault_stops_the_drives(const std::string &toml) {
    Rig rig(toml);
    rig.control.post(Request::drive_fault);
    EXPECT(rig.wait(0.01).state == OperatingState::disabled);
    rig.control.post(Request::enable);
    rig.move(0.5);
    rig.control.post(Request::drive_fault);
    Tick tick = rig.move(0.1);
    EXPECT(!tick.is_sent && tick.state == OperatingState::fault);
    EXPECT(rig.control.status().reaction == TAUTSCOPE_REACTION_QUICK_STOP);
    rig.control.post(Request::resume);
    tick = rig.wait(0.01);
    EXPECT(tick.state == OperatingState::fault);
    rig.largest_step = 0.0;
    rig.control.post(Request::enable);
    tick = rig.move(0.5);
    EXPECT(tick.is_sent && tick.state == OperatingState::enabled && rig.largest_step < 1e-3);

    // Drives repeat a fault; the operator enables too early, and again when it is cleared.
    const auto repeat = [&](double duration) {
        for (const double end = rig.time + duration; rig.time < end;) {
            rig.control.post(Request::drive_fault);
            tick = rig.wait(0.1);
        }
    };
    repeat(10.0);
    EXPECT(rig.control.status().reaction == TAUTSCOPE_REACTION_QUICK_STOP);
    rig.control.post(Request::enable);
    repeat(1.0);
    EXPECT(!tick.is_sent && tick.state == OperatingState::fault);
    rig.control.post(Request::enable);
    tick = rig.move(0.5);
    EXPECT(tick.is_sent && tick.state == OperatingState::enabled);
}

void silent_drives_are_a_drive_fault(const std::string &toml) {
    for (const Request request : {Request::enable, Request::pause}) {
        Rig rig(toml);
        rig.control.post(Request::enable);
        rig.move(0.5);
        rig.control.post(request);
        rig.move(0.5);
        rig.are_silent = true;
        const double silent_since = rig.time - rig.control.period();
        EXPECT(rig.move(0.09).is_sent);
        const Tick tick = rig.move(rig.control.period() + silent_since + 0.1 - rig.time);
        EXPECT(!tick.is_sent && tick.state == OperatingState::fault);
        EXPECT(rig.control.status().flags & (1U << TAUTSCOPE_FLAG_DRIVE_FAULT));
        // However long it lasts: enabled when they are back, not before.
        rig.move(10.0);
        rig.control.post(Request::enable);
        EXPECT(rig.move(0.1).state == OperatingState::disabled && rig.control.status().is_unmeasured);
        rig.are_silent = false;
        rig.control.post(Request::enable);
        EXPECT(rig.move(0.1).state == OperatingState::enabled);
    }
}

void a_position_of_long_ago_is_none(const std::string &toml) {
    for (const double age : {0.11, 3600.0, -3600.0}) {
        ControlLoop control(toml);
        control.set_measured(start, 100.0);
        control.step(100.0);
        control.post(Request::enable);
        EXPECT(!control.step(100.0 + age).is_sent && control.status().is_unmeasured);
    }
}

void motion_begins_where_the_drives_are(const std::string &toml) {
    Rig rig(toml);
    const Values measured(Numbers{35e-3, 0.1, 0.8});
    EXPECT(!rig.control.set_measured({nan, nan, nan}, rig.time) && !rig.control.set_measured({0.0, 0.9}, rig.time));
    rig.drives = measured;
    rig.control.post(Request::enable);
    Tick tick = rig.wait(0.1);
    EXPECT(tick.is_sent && tick.command == measured);
    rig.largest_step = 0.0;
    tick = rig.move(0.5);
    EXPECT(tick.state == OperatingState::enabled && rig.largest_step < 1e-3);
    EXPECT(tick.command[0] > measured[0] && tick.command[0] < measured[0] + 15e-3);
    // Enabled again where the command was, and refused elsewhere.
    rig.control.post(Request::disable);
    rig.wait(1.0);
    rig.control.post(Request::enable);
    EXPECT(rig.wait(0.01).state == OperatingState::enabled);
    rig.control.post(Request::disable);
    rig.wait(0.1);
    rig.drives = Values(Numbers{tick.command[0] + 2e-3, tick.command[1], tick.command[2]});
    rig.control.post(Request::enable);
    tick = rig.move(0.1);
    EXPECT(!tick.is_sent && tick.state == OperatingState::fault && rig.control.status().is_misplaced);
}

void the_first_reference_is_where_the_operator_is(const std::string &toml) {
    for (const bool is_resumed : {false, true}) {
        for (const bool is_chained : {false, true}) {
            Rig rig(toml);
            rig.control.post(Request::enable);
            if (is_resumed) {
                rig.control.post(Request::pause);
                rig.control.set_measured(start, rig.time - 1.0);
                rig.control.step(rig.time - 1.0);
                rig.control.post(Request::resume);
            }
            rig.reference = {45e-3, 1.5, 0.2};
            for (int tick = 0; tick < 20; ++tick) {
                // A reference of each tick, made in it.
                rig.control.set_reference(rig.reference, is_chained ? nan : rig.time);
                const Tick rest = rig.wait(rig.control.period() / 2);
                EXPECT(rest.is_sent && rest.command == Values(start));
            }
            rig.move(0.5);
            EXPECT(rig.last_motion > rig.time - 2 * rig.control.period() && rig.largest_step < 1e-3);
        }
    }
}

void enable_is_refused_while_it_is_not_known_where_the_drives_are(const std::string &toml) {
    ControlLoop control(toml);
    control.set_measured({nan, 0.0, 0.9}, 0.0);
    control.post(Request::enable);
    control.set_reference(start, 0.0);
    EXPECT(!control.step(0.0).is_sent && control.status().state == OperatingState::disabled && control.status().is_unmeasured);
    control.set_measured(start, 0.0);
    control.post(Request::enable);
    EXPECT(control.step(0.005).is_sent && !control.status().is_unmeasured);
}

void a_reference_from_before_neither_begins_nor_stops_a_motion(const std::string &toml) {
    Rig rig(toml);
    rig.control.post(Request::enable);
    rig.control.set_reference(start, rig.time - 1.0);
    Tick tick = rig.wait(0.5);
    EXPECT(tick.is_sent && tick.command == Values(start) && tick.state == OperatingState::enabled);
    rig.move(0.5);
    rig.control.post(Request::pause);
    rig.wait(0.5);
    rig.control.post(Request::resume);
    rig.control.set_reference({40e-3, 0.0, 0.9}, rig.time - 0.2);
    rig.last_motion = nan;
    tick = rig.wait(0.5);
    EXPECT(tick.state == OperatingState::enabled && std::isnan(rig.last_motion));
}

void what_is_not_finite_changes_nothing(const std::string &toml) {
    Rig rig(toml);
    rig.control.post(Request::enable);
    rig.move(0.5);
    const Tick before = rig.wait(0.01);
    rig.control.set_reference({nan, 0.0, 0.9}, rig.time);
    EXPECT(rig.wait(0.01).command == before.command);
    EXPECT(!rig.control.set_compensation(nan) && !rig.control.set_compensation(1.1) && rig.control.set_compensation(0.0));
}

void state_commands_are_those_of_crtk() {
    EXPECT(parse_state_command("enable") == Request::enable);
    EXPECT(parse_state_command("resume") == Request::resume);
    EXPECT(!parse_state_command("home") && !parse_state_command("ENABLE") && !parse_state_command(""));
    EXPECT(flag_names(0).empty());
    EXPECT(flag_names((1U << TAUTSCOPE_FLAG_LOST) | (1U << TAUTSCOPE_FLAG_LATE) | (1U << 31)) == "late, lost");
}

} // namespace

int main(int count, char **arguments) try {
    const std::string toml = tautscope::read_file(count == 2 ? arguments[1] : "best.toml");
    disabled_until_enabled(toml);
    a_silent_device_stops_the_motion(toml);
    a_jump_stops_the_motion(toml);
    a_pause_holds_until_resumed(toml);
    a_drive_fault_stops_the_drives(toml);
    silent_drives_are_a_drive_fault(toml);
    a_position_of_long_ago_is_none(toml);
    motion_begins_where_the_drives_are(toml);
    the_first_reference_is_where_the_operator_is(toml);
    enable_is_refused_while_it_is_not_known_where_the_drives_are(toml);
    a_reference_from_before_neither_begins_nor_stops_a_motion(toml);
    what_is_not_finite_changes_nothing(toml);
    state_commands_are_those_of_crtk();
    std::printf("%d failures\n", failures);
    return failures > 0;
} catch (const std::exception &error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
}
