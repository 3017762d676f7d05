#include "tubetrack/tracker/tracker_config.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace tubetrack {

namespace {

tl::unexpected<Error> refuse(const char* field, double got, const char* takes) {
  return tl::make_unexpected(Error::usage(fmt::format("{}: got {:g}, takes {}", field, got, takes)));
}

bool within(double value, double low, double high) {
  return std::isfinite(value) && value >= low && value <= high;
}

}  // namespace

Expected<void> validate(const TrackerConfig& c) {
  if (c.radius_m && !within(*c.radius_m, 1e-4, 10.0)) return refuse("radius_m", *c.radius_m, "metres, 0.0001 to 10");
  if (c.radius_m && c.varying_radius) {
    return tl::make_unexpected(Error::usage(
        "varying_radius: got true, takes false where radius_m is given, as that is held; give radius_min_m and "
        "radius_max_m instead"));
  }
  if (!within(c.radius_min_m, 1e-4, 10.0)) return refuse("radius_min_m", c.radius_min_m, "metres, 0.0001 to 10");
  if (!within(c.radius_max_m, c.radius_min_m, 10.0)) {
    return refuse("radius_max_m", c.radius_max_m, "metres, radius_min_m to 10");
  }
  if (!within(c.depth_min_m, 0.0, 100.0)) return refuse("depth_min_m", c.depth_min_m, "metres, 0 to 100");
  if (!within(c.depth_max_m, c.depth_min_m + 1e-3, 1000.0)) {
    return refuse("depth_max_m", c.depth_max_m, "metres, above depth_min_m and at most 1000");
  }
  if (c.radius_m && *c.radius_m >= c.depth_max_m) {
    return refuse("radius_m", *c.radius_m, "metres, less than depth_max_m: is it in millimetres?");
  }
  if (c.roi_width_px < 0 || c.roi_height_px < 0 || c.roi_u_px < 0 || c.roi_v_px < 0) {
    return refuse("roi", std::min({c.roi_u_px, c.roi_v_px, c.roi_width_px, c.roi_height_px}),
                  "u,v,w,h in pixels, all ≥ 0");
  }
  if (!within(c.min_length_radii, 0.5, 100.0))
    return refuse("min_length_radii", c.min_length_radii, "0.5 to 100 radii");
  if (!within(c.min_length_m, 0.0, 100.0)) return refuse("min_length_m", c.min_length_m, "metres, 0 to 100");
  if (!within(c.min_width_px, 4.0, 1000.0)) return refuse("min_width_px", c.min_width_px, "4 to 1000 pixels");
  if (!within(c.min_bend_radii, 1.0, 1000.0)) return refuse("min_bend_radii", c.min_bend_radii, "1 to 1000 radii");
  if (c.cell_m && !within(*c.cell_m, 1e-4, 0.1)) return refuse("cell_m", *c.cell_m, "metres, 0.0001 to 0.1");
  if (c.deadline_ms && !within(*c.deadline_ms, 0.01, 1e6))
    return refuse("deadline_ms", *c.deadline_ms, "milliseconds, 0.01 to 1000000");
  if (c.threads < 1 || c.threads > 16) return refuse("threads", c.threads, "1 to 16");
  return {};
}

}  // namespace tubetrack
