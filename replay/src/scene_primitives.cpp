#include "ray_cast.hpp"
#include "tubetrack/replay/tube_path.hpp"

namespace tubetrack {

namespace {

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
      const Eigen::Vector3d start = place * part.start_m;
      const Eigen::Vector3d tangent = turned(part.tangent);
      const Eigen::Vector3d towards = turned(part.towards);
      if (part.type == TubePart::Type::straight) {
        add(FrustumWall{start, tangent, part.length_m, tube.radius_m, tube.radius_m});
      } else {
        add(TorusArc{start + part.bend_radius_m * towards, -towards, tangent, part.bend_radius_m, tube.radius_m,
                     part.length_m / part.bend_radius_m});
      }
    }
    const CenterlinePoint end = point_on_part(parts.back(), parts.back().length_m);
    add(Disc{place * parts.front().start_m, turned(parts.front().tangent), tube.radius_m});
    add(Disc{place * end.position_m, turned(end.tangent), tube.radius_m});
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
