#pragma once

#include <string>

namespace tubetrack {

/// A device that a live back-end can open.
struct DeviceDescription {
  std::string uri;  ///< what opens it
  std::string vendor;
  std::string name;
};

}  // namespace tubetrack
