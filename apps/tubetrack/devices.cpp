#include <fmt/format.h>

#include <cstdio>
#include <vector>

#include "commands.hpp"
#include "device.hpp"
#include "run.hpp"
#include "tubetrack/sensors/device_description.hpp"

#ifdef TUBETRACK_HAS_LIBCAMERA
#include "tubetrack/sensors/libcamera_source.hpp"
#endif
#ifdef TUBETRACK_HAS_OPENNI2
#include "tubetrack/sensors/openni2_source.hpp"
#endif

namespace tubetrack {

namespace {

[[maybe_unused]] void print(const std::vector<DeviceDescription>& devices) {
  for (const DeviceDescription& device : devices) fmt::print("{}\t{} {}\n", device.uri, device.vendor, device.name);
}

/// libcamera's are listed as well as they can be: a machine without any is no error.
std::size_t list_libcamera() {
#ifdef TUBETRACK_HAS_LIBCAMERA
  const auto cameras = list_libcamera_devices();
  if (!cameras) {
    fmt::print(stderr, "note: {}\n", cameras.error().message);
    return 0;
  }
  print(*cameras);
  return cameras->size();
#else
  return 0;
#endif
}

int list_devices() {
#ifdef TUBETRACK_HAS_OPENNI2
  const auto devices = list_openni2_devices();
  if (!devices) return report_error(devices.error());
  print(*devices);
  if (list_libcamera() + devices->size() == 0) {
    fmt::print(stderr,
               "no OpenNI2 device found, and no libcamera camera; plugged in, and readable by you? without a sensor: "
               "scripts/virtual-device RECORDING tubetrack devices\n");
  }
  return 0;
#else
  if (list_libcamera() > 0) return 0;
  return report_error(without_openni2());
#endif
}

}  // namespace

void add_devices(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("devices", "list the live depth cameras that are plugged in");
  command->footer(
      "One device a line: its URI (for `tubetrack live URI`), a tab, maker and name. None: exit code 0 too. "
      "libcamera's\n"
      "cameras are listed whatever they send; one that sends only Y16 or Z16 is listed from libcamera 0.3.0 on.");
  command->callback([&exit_code] { exit_code = list_devices(); });
}

}  // namespace tubetrack
