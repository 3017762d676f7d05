#include "interrupts.hpp"

#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstdlib>
#include <string_view>

namespace tubetrack {

namespace {

constexpr unsigned kPatience_s = 3;
constexpr std::string_view kHung =
    "tubetrack: the device's driver does not let go; ended all the same, what was written is whole\n";

std::atomic<bool> g_interrupted{false};
std::atomic<bool> g_hurry{false};
static_assert(std::atomic<bool>::is_always_lock_free, "set from a signal handler");

void on_interrupt(int) {
  g_interrupted = true;
  if (g_hurry) alarm(kPatience_s);
}

void on_alarm(int) {
  [[maybe_unused]] const auto written = write(STDERR_FILENO, kHung.data(), kHung.size());
  _Exit(1);
}

}  // namespace

void catch_interrupts() {
  g_interrupted = false;
  struct sigaction action = {};
  action.sa_handler = on_interrupt;
  action.sa_flags = static_cast<int>(SA_RESETHAND);  // a second Ctrl-C ends the program
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  action.sa_handler = on_alarm;
  sigaction(SIGALRM, &action, nullptr);
}

bool interrupted() {
  return g_interrupted;
}

void hurry_when_interrupted() {
  g_hurry = true;
}

void no_hurry() {
  g_hurry = false;
  alarm(0);
}

}  // namespace tubetrack
