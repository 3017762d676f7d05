#include <fmt/format.h>

#include "commands.hpp"
#include "device.hpp"
#include "run.hpp"

#ifdef TUBETRACK_HAS_OPENNI2
#include "tubetrack/sensors/openni2_source.hpp"
#endif

namespace tubetrack {

namespace {

int list_devices() {
#ifdef TUBETRACK_HAS_OPENNI2
  const auto devices = list_openni2_devices();
  if (!devices) return report_error(devices.error());
  for (const DeviceDescription& device : *devices) {
    fmt::print("{}\t{} {}\n", device.uri, device.vendor, device.name);
  }
  if (devices->empty()) {
    fmt::print(stderr,
               "no OpenNI2 device found; plugged in, and readable by you? without a sensor: scripts/virtual-device "
               "RECORDING tubetrack devices\n");
  }
  return 0;
#else
  return report_error(without_openni2());
#endif
}

}  // namespace

void add_devices(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("devices", "list the OpenNI2 depth cameras that are plugged in");
  command->footer(
      "One device a line: its URI (for `tubetrack live URI`), a tab, maker and name. None: exit code 0 too.");
  command->callback([&exit_code] { exit_code = list_devices(); });
}

}  // namespace tubetrack
