#pragma once

namespace tubetrack {

/// From here on Ctrl-C (SIGINT, SIGTERM) sets `interrupted()`; a second one ends the program at once. A program that
/// has not ended 5 s after the first, as a driver doesn't let go, is ended with exit code 1: everything written is
/// whole.
void catch_interrupts();
bool interrupted();
/// What is left to do after Ctrl-C may take its time.
void no_hurry();

}  // namespace tubetrack
