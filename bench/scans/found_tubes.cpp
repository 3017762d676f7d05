#include "found_tubes.hpp"

#include <stdexcept>
#include <utility>

#include "scan_result.hpp"

namespace tubetrack::bench {

TubeFrame found_tubes(const Scan& scan, std::span<const ScanSurfel> surfels) {
  ScanTubesConfig config;
  auto found = tubes_of_scan(scan, surfels, config, true);
  if (!found) throw std::logic_error(found.error().message);
  return std::move(*found);
}

}  // namespace tubetrack::bench
