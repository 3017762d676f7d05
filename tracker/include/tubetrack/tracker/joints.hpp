#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "tubetrack/tracker/tube.hpp"

namespace tubetrack {

/// Where tubes branch: which of them meet there, and with what.
struct TubeJoint {
  enum class At { start, end, flank };
  struct Part {
    std::int64_t tube = 0;  ///< its id
    At at = At::start;
    double along_m = 0.0;  ///< from the tube's start along its nodes
  };
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  std::vector<Part> parts;  ///< two or more
};

/// The joints of tubes: an end that runs on into another tube's end or flank is joined to it. That is so where the end
/// lies within the other, or where the other's axis lies ahead of it (within 50° of its direction) with its surface no
/// farther than 3 of the end's radii; the nearest counts. An axis within 1.5 radii of its own end is joined by that
/// end. What meets within a radius is one joint. In the tubes' frame; closed tubes have no ends of their own. In the
/// order of the first tube of each.
std::vector<TubeJoint> joints_of(std::span<const Tube> tubes);

}  // namespace tubetrack
