#include <algorithm>
#include <cmath>

#include "ray_cast.hpp"
#include "tubetrack/replay/tube_path.hpp"

namespace tubetrack {

namespace {

/// Where the radius of a straight has keys, and its ends.
std::vector<double> cuts_at_keys(const SceneTube& tube, const PlacedPart& part) {
  std::vector<double> cuts{0.0};
  for (const RadiusKey& key : tube.radius_profile) {
    const double cut_m = key.at_m - part.from_m;
    if (cut_m > 1e-9 && cut_m < part.length_m - 1e-9) cuts.push_back(cut_m);
  }
  cuts.push_back(part.length_m);
  return cuts;
}

std::vector<double> even_cuts(double length_m) {
  constexpr double kStep_m = 0.001;
  const int pieces = std::max(1, static_cast<int>(std::ceil(length_m / kStep_m)));
  std::vector<double> cuts;
  for (int i = 0; i <= pieces; ++i) cuts.push_back(length_m * i / pieces);
  return cuts;
}

/// Appends a shape's primitives; `place` takes the shape's coordinates (world, time 0) to the camera's now.
struct AddPrimitives {
  std::vector<Primitive>& out;
  int object;
  Eigen::Isometry3d place;

  void add(PrimitiveShape shape) const { out.push_back({std::move(shape), object}); }
  Eigen::Vector3d turned(const Eigen::Vector3d& direction) const { return (place.linear() * direction).normalized(); }

  void operator()(const PlaneShape& plane) const { add(InfinitePlane{place * plane.point_m, turned(plane.normal)}); }
  void operator()(const BoxShape& box) const {
    Eigen::Isometry3d world_from_box = Eigen::Isometry3d::Identity();
    world_from_box.translate(box.center_m).rotate(box.rotation.normalized());
    add(OrientedBox{(place * world_from_box).inverse(), 0.5 * box.size_m});
  }
  void operator()(const SphereShape& sphere) const {
    add(SphereWall{place * sphere.center_m, sphere.radius_m, false, Eigen::Vector3d::UnitZ()});
  }
  void operator()(const CapsuleShape& capsule) const {
    const Eigen::Vector3d from = place * capsule.from_m;
    const Eigen::Vector3d to = place * capsule.to_m;
    add(FrustumWall{from, (to - from).normalized(), (to - from).norm(), capsule.radius_m, capsule.radius_m});
    add(SphereWall{from, capsule.radius_m, false, Eigen::Vector3d::UnitZ()});
    add(SphereWall{to, capsule.radius_m, false, Eigen::Vector3d::UnitZ()});
  }
  void operator()(const FrustumShape& frustum) const {
    const Eigen::Vector3d from = place * frustum.from_m;
    const Eigen::Vector3d to = place * frustum.to_m;
    const Eigen::Vector3d axis = (to - from).normalized();
    add(FrustumWall{from, axis, (to - from).norm(), frustum.from_radius_m, frustum.to_radius_m});
    add(Disc{from, axis, frustum.from_radius_m});
    add(Disc{to, axis, frustum.to_radius_m});
  }
  void operator()(const BowlShape& bowl) const {
    add(SphereWall{place * bowl.center_m, bowl.radius_m, true, turned(bowl.opening)});
  }
  void operator()(const SceneTube& tube) const {
    const std::vector<PlacedPart> parts = place_parts(tube);
    for (const PlacedPart& part : parts) {
      if (!tube.radius_profile.empty()) {
        add_varying_part(tube, part);
      } else if (part.type == TubePart::Type::straight) {
        add(FrustumWall{place * part.start_m, turned(part.tangent), part.length_m, tube.radius_m, tube.radius_m});
      } else {
        add(torus_of(part, part.length_m, tube.radius_m));
      }
    }
    const CenterlinePoint end = point_on_part(parts.back(), parts.back().length_m);
    add(Disc{place * parts.front().start_m, turned(parts.front().tangent), radius_along_m(tube, 0.0)});
    add(Disc{place * end.position_m, turned(end.tangent), radius_along_m(tube, total_length_m(parts))});
  }
  TorusArc torus_of(const PlacedPart& arc, double length_m, double radius_m) const {
    const Eigen::Vector3d towards = turned(arc.towards);
    return {place * arc.start_m + arc.bend_radius_m * towards,
            -towards,
            turned(arc.tangent),
            arc.bend_radius_m,
            radius_m,
            length_m / arc.bend_radius_m};
  }
  /// A straight of varying radius is exact: a cone from key to key. A bend has no closed form; it is cut into short
  /// tori, each of the radius at its middle, with discs that close the steps between them.
  void add_varying_part(const SceneTube& tube, const PlacedPart& part) const {
    const bool straight = part.type == TubePart::Type::straight;
    const std::vector<double> cuts = straight ? cuts_at_keys(tube, part) : even_cuts(part.length_m);
    const auto radius_m = [&](double along_m) { return radius_along_m(tube, part.from_m + along_m); };
    for (std::size_t i = 0; i + 1 < cuts.size(); ++i) {
      const double length_m = cuts[i + 1] - cuts[i];
      const CenterlinePoint from = point_on_part(part, cuts[i]);
      if (straight) {
        add(FrustumWall{place * from.position_m, turned(from.tangent), length_m, radius_m(cuts[i]),
                        radius_m(cuts[i + 1])});
        continue;
      }
      PlacedPart piece = part;
      piece.start_m = from.position_m;
      piece.tangent = from.tangent;
      piece.towards = (part.start_m + part.bend_radius_m * part.towards - from.position_m).normalized();
      add(torus_of(piece, length_m, radius_m(cuts[i] + 0.5 * length_m)));
    }
    for (std::size_t i = 0; i < cuts.size() && !straight; ++i) {
      const CenterlinePoint at = point_on_part(part, cuts[i]);
      const double half_m = 0.5 * part.length_m / static_cast<double>(cuts.size() - 1);
      const double larger_m = std::max(radius_m(cuts[i] - half_m), radius_m(cuts[i] + half_m));
      add(Disc{place * at.position_m, turned(at.tangent), larger_m});
    }
  }
};

}  // namespace

std::vector<Primitive> primitives_of(const Scene& scene, int frame) {
  std::vector<Primitive> primitives;
  const double time_s = frame_time_s(scene, frame);
  const Eigen::Isometry3d camera_from_world = world_from_camera(scene, frame).inverse();
  int object = 0;
  for (const SceneTube& tube : scene.tubes) {
    AddPrimitives{primitives, object++, camera_from_world * motion_at(tube.motion, time_s)}(tube);
  }
  for (const Solid& solid : scene.solids) {
    std::visit(AddPrimitives{primitives, object++, camera_from_world * motion_at(solid.motion, time_s)}, solid.shape);
  }
  return primitives;
}

}  // namespace tubetrack
