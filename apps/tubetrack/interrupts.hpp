#pragma once

namespace tubetrack {

/// From here on Ctrl-C (SIGINT, SIGTERM) sets `interrupted()`; a second one ends the program at once.
void catch_interrupts();
bool interrupted();

/// A program with a live device that has not ended 3 s after Ctrl-C, as a driver doesn't let go, is ended then with
/// exit code 1: everything written is whole.
void hurry_when_interrupted();
/// The device is closed: what is left to do may take its time.
void no_hurry();

}  // namespace tubetrack
