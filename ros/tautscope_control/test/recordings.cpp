/* 60 s of references and features from record.py through the control loop: the commands and estimates have the bits that they had
   in Python, and nothing is allocated. */

#include <cstdio>
#include <string>
#include <vector>

#include <tautscope_control/control_loop.hpp>

#include "allocations.hpp"
#include "recording.hpp"

using namespace tautscope_control;

namespace {

void apply(ControlLoop &control, int event) {
    switch (event) {
    case 1:
        // What held the motion decides how it continues.
        control.post(control.status().state == OperatingState::fault ? Request::enable : Request::resume);
        break;
    case 2:
        control.post(Request::acknowledge);
        break;
    case 3:
        control.post(Request::drive_fault);
        break;
    case 4:
        control.set_compensation(0.5);
        break;
    case 5:
        control.set_compensation(1.0);
        break;
    default:
        break;
    }
}

} // namespace

int main(int count, char **arguments) try {
    const std::string recording = count == 2 ? arguments[1] : "best";
    ControlLoop control(tautscope::read_file(recording + ".toml"));
    const auto ticks = read_rows<::Tick>(recording + ".ticks");
    const auto images = read_rows<ImageUpdate>(recording + ".images");
    Values drives(ticks.at(0).reference);
    control.post(Request::enable);

    const unsigned long allocated = allocations::count;
    std::size_t wrong = 0, image = 0, held = 0, stopped = 0;
    for (std::size_t tick = 0; tick < ticks.size(); ++tick) {
        const ::Tick &now = ticks[tick];
        apply(control, static_cast<int>(now.event));
        control.set_reference(now.reference, now.made_at);
        control.set_measured(drives, now.time);
        const tautscope_control::Tick result = control.step(now.time);
        drives = result.command;
        const double values[] = {result.command[0], result.command[1], result.command[2]};
        wrong += !is_same(values, now.command);
        held += result.state == OperatingState::paused;
        stopped += result.state == OperatingState::fault;
        wrong += result.is_sent == (result.state == OperatingState::fault);
        control.exchange();
        for (; image < images.size() && static_cast<std::size_t>(images[image].tick) == tick; ++image) {
            wrong += !is_same(update(control.loop(), images[image]), images[image]);
        }
    }
    const unsigned long in_loop = allocations::count - allocated;
    std::printf("%zu ticks, %zu of them held and %zu in fault, %zu image updates, %zu unlike Python, ", ticks.size(), held,
                stopped, image, wrong);
    if (ALLOCATIONS_ARE_COUNTED) {
        std::printf("%lu allocations\n", in_loop);
    } else {
        std::printf("allocations not counted\n");
    }
    return ticks.empty() || image != images.size() || held == 0 || stopped == 0 || wrong > 0 || in_loop > 0;
} catch (const std::exception &error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
}
