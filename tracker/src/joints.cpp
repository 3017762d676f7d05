#include "tubetrack/tracker/joints.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>

namespace tubetrack {

namespace {

constexpr double kReachRadii = 3.0;      // of the end that runs on, to the other's surface
constexpr double kCosAhead = 0.64;       // cosine of 50°
constexpr double kOwnEndRadii = 1.5;     // so near to its end a tube is met at its end
constexpr double kDirectionRadii = 2.0;  // an end's direction is that of so much of it

struct OpenEnd {
  std::size_t tube = 0;
  bool front = false;
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d outward = Eigen::Vector3d::UnitX();  ///< unit
};

OpenEnd end_of(std::span<const Tube> tubes, std::size_t tube, bool front) {
  const auto& line_m = tubes[tube].centerline_m;
  const std::size_t last = line_m.size() - 1;
  OpenEnd end{tube, front, line_m[front ? 0 : last]};
  std::size_t back = 1;
  while (back < last &&
         (line_m[front ? back : last - back] - end.position_m).norm() < kDirectionRadii * tubes[tube].radius_m)
    ++back;
  end.outward = (end.position_m - line_m[front ? back : last - back]).normalized();
  return end;
}

/// Where an end runs into another tube.
struct Meeting {
  std::size_t tube = 0;
  std::size_t node = 0;
  double gap_m = 0.0;  ///< from the end to the other's surface; below 0 inside
};

std::optional<Meeting> meeting_of(const OpenEnd& end, std::span<const Tube> tubes) {
  std::optional<Meeting> best;
  const double radius_m = tubes[end.tube].radius_m;
  for (std::size_t other = 0; other < tubes.size(); ++other) {
    if (other == end.tube) continue;
    const Tube& tube = tubes[other];
    for (std::size_t node = 0; node < tube.centerline_m.size(); ++node) {
      const Eigen::Vector3d way_m = tube.centerline_m[node] - end.position_m;
      const double gap_m = way_m.norm() - tube.radius_m;
      // An end within another tube meets it wherever it points: a line may turn where bodies run into each other.
      const bool ahead = way_m.dot(end.outward) >= kCosAhead * way_m.norm();
      if (gap_m > kReachRadii * radius_m || (gap_m > 0.0 && !ahead)) continue;
      if (!best || gap_m < best->gap_m) best = Meeting{other, node, gap_m};
    }
  }
  return best;
}

/// How a tube takes part that is met at this node.
TubeJoint::Part part_at(const Tube& tube, std::size_t node) {
  const auto& line_m = tube.centerline_m;
  TubeJoint::Part part{tube.id, TubeJoint::At::flank, 0.0};
  double along_m = 0.0, length_m = 0.0;
  for (std::size_t i = 1; i < line_m.size(); ++i) {
    length_m += (line_m[i] - line_m[i - 1]).norm();
    if (i <= node) along_m = length_m;
  }
  part.along_m = along_m;
  const double near_m = kOwnEndRadii * tube.radius_m;
  if (tube.closed || std::min(along_m, length_m - along_m) > near_m) return part;
  part.at = along_m < length_m - along_m ? TubeJoint::At::start : TubeJoint::At::end;
  part.along_m = part.at == TubeJoint::At::start ? 0.0 : length_m;
  return part;
}

bool is_same(const TubeJoint::Part& a, const TubeJoint::Part& b) {
  return a.tube == b.tube && a.at == b.at && a.at != TubeJoint::At::flank;
}

/// Whether a joint has this end already, or lies where the other does.
bool belongs(const TubeJoint& joint, const TubeJoint& other, double near_m) {
  if ((joint.position_m - other.position_m).norm() < near_m) return true;
  return std::any_of(joint.parts.begin(), joint.parts.end(), [&](const TubeJoint::Part& a) {
    return std::any_of(other.parts.begin(), other.parts.end(), [&](const TubeJoint::Part& b) { return is_same(a, b); });
  });
}

void merge(TubeJoint& joint, const TubeJoint& other) {
  joint.position_m = 0.5 * (joint.position_m + other.position_m);
  for (const TubeJoint::Part& part : other.parts) {
    const bool known = std::any_of(joint.parts.begin(), joint.parts.end(), [&](const TubeJoint::Part& own) {
      return is_same(own, part) || (own.tube == part.tube && own.at == part.at);
    });
    if (!known) joint.parts.push_back(part);
  }
}

}  // namespace

std::vector<TubeJoint> joints_of(std::span<const Tube> tubes) {
  std::vector<TubeJoint> joints;
  for (std::size_t i = 0; i < tubes.size(); ++i) {
    if (tubes[i].closed || tubes[i].centerline_m.size() < 2) continue;
    for (const bool front : {true, false}) {
      const OpenEnd end = end_of(tubes, i, front);
      const auto meeting = meeting_of(end, tubes);
      if (!meeting) continue;
      const Tube& other = tubes[meeting->tube];
      TubeJoint joint;
      const TubeJoint::Part met = part_at(other, meeting->node);
      joint.parts = {part_at(tubes[i], front ? 0 : tubes[i].centerline_m.size() - 1), met};
      // On the other's axis where its flank is met, else between the two ends.
      joint.position_m = other.centerline_m[meeting->node];
      if (met.at != TubeJoint::At::flank) joint.position_m = 0.5 * (joint.position_m + end.position_m);
      const double near_m = std::max(tubes[i].radius_m, other.radius_m);
      const auto known = std::find_if(joints.begin(), joints.end(),
                                      [&](const TubeJoint& earlier) { return belongs(earlier, joint, near_m); });
      if (known == joints.end()) {
        joints.push_back(std::move(joint));
      } else {
        merge(*known, joint);
      }
    }
  }
  return joints;
}

}  // namespace tubetrack
