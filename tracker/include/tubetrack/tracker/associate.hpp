#pragma once

#include <vector>

#include "tubetrack/tracker/tube.hpp"

namespace tubetrack {

/// Tubes seen lately, by which new ones get their identity.
struct Identities {
  struct Known {
    Tube tube;
    int frames_away = 0;
  };
  std::vector<Known> known;
  std::int64_t next_id = 1;
};

/// Mean distance in metres from a's centreline to b's polyline; infinite where either is empty.
double centerline_distance_m(const Tube& a, const Tube& b);

/// Gives every tube the id of the nearest known one (radius within a quarter, centrelines nearer than a diameter), or a
/// new one. Known tubes are forgotten after 30 frames away.
void associate(Identities& identities, std::vector<Tube>& tubes);

}  // namespace tubetrack
