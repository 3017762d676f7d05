#include "openni2_runtime.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <mutex>

namespace tubetrack {

std::string openni2_says() {
  std::string text = openni::OpenNI::getExtendedError();
  std::replace(text.begin(), text.end(), '\n', ' ');
  text.erase(0, text.find_first_not_of(" \t"));
  text.erase(text.find_last_not_of(" \t") + 1);
  return text.empty() ? "the runtime gives no reason" : text;
}

Expected<std::shared_ptr<OpenNi2Runtime>> use_openni2() {
  static std::mutex mutex;
  static std::weak_ptr<OpenNi2Runtime> running;
  const std::lock_guard lock(mutex);
  if (auto runtime = running.lock()) return runtime;
  if (openni::OpenNI::initialize() != openni::STATUS_OK) {
    // Without a driver the runtime fails with an empty text, so the likely cause is said here.
    return openni2_failed(
        fmt::format("OpenNI2: the runtime did not start ({}); it looks for OpenNI2/Drivers/lib*.so.0 beside the "
                    "libOpenNI2.so.0 that was loaded; install libopenni2-0, or put a complete folder first in "
                    "LD_LIBRARY_PATH",
                    openni2_says()));
  }
  auto runtime = std::make_shared<OpenNi2Runtime>();
  running = runtime;
  return runtime;
}

UnplugListener::UnplugListener(std::string uri) : uri_(std::move(uri)) {
  openni::OpenNI::addDeviceDisconnectedListener(this);
}

UnplugListener::~UnplugListener() {
  openni::OpenNI::removeDeviceDisconnectedListener(this);
}

void UnplugListener::onDeviceDisconnected(const openni::DeviceInfo* info) {
  if (uri_ == info->getUri()) unplugged_ = true;
}

std::vector<DeviceDescription> openni2_devices_now() {
  openni::Array<openni::DeviceInfo> found;
  openni::OpenNI::enumerateDevices(&found);
  std::vector<DeviceDescription> devices;
  devices.reserve(static_cast<std::size_t>(found.getSize()));
  for (int i = 0; i < found.getSize(); ++i) {
    devices.push_back({found[i].getUri(), found[i].getVendor(), found[i].getName()});
  }
  return devices;
}

Expected<std::vector<DeviceDescription>> list_openni2_devices() {
  const auto runtime = use_openni2();
  if (!runtime) return tl::make_unexpected(runtime.error());
  return openni2_devices_now();
}

}  // namespace tubetrack
