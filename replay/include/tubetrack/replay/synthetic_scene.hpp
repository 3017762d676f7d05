#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "tubetrack/sensors/error.hpp"
#include "tubetrack/sensors/intrinsics.hpp"

namespace tubetrack {

// All points and directions of a scene are in its world frame: x right, y down, z forward, metres. Without a camera
// path the world frame is the camera frame.

/// A rigid motion that starts at time 0: a turn about `center_m` at a constant rate, then a shift at constant speed.
struct Motion {
  Eigen::Vector3d velocity_m_s = Eigen::Vector3d::Zero();
  Eigen::Vector3d angular_velocity_rad_s = Eigen::Vector3d::Zero();
  Eigen::Vector3d center_m = Eigen::Vector3d::Zero();
};

/// Where the motion has taken a point that was at p at time 0: motion_at(m, t) * p.
Eigen::Isometry3d motion_at(const Motion& motion, double time_s);

/// One part of a tube. An arc turns towards the tube's bend direction after that was turned by `rotation_rad` about
/// the tube, right-handed along it (the "rotation" of a bend table).
struct TubePart {
  enum class Type { straight, arc };
  Type type = Type::straight;
  double length_m = 0.0;       ///< straight only
  double bend_radius_m = 0.0;  ///< arc only: of the centreline, above the tube's radius
  double angle_rad = 0.0;      ///< arc only: 0 to 2π, exclusive
  double rotation_rad = 0.0;   ///< arc only

  static TubePart straight(double length_m);
  static TubePart arc(double bend_radius_m, double angle_rad, double rotation_rad = 0.0);
};

/// A tube's radius at one place: between two keys it changes evenly, before the first and behind the last it stays.
struct RadiusKey {
  double at_m = 0.0;  ///< arc length from the tube's start
  double radius_m = 0.0;
};

/// A round tube with flat end caps. Its id in the truth is its place in Scene::tubes, from 1.
struct SceneTube {
  double radius_m = 0.0125;  ///< where `radius_profile` is not empty: not looked at
  Eigen::Vector3d start_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d direction = Eigen::Vector3d::UnitX();       ///< any length above 0
  Eigen::Vector3d bend_direction = Eigen::Vector3d::UnitY();  ///< where an arc of rotation 0 turns to; ∦ direction
  std::vector<TubePart> parts;
  Motion motion;
  std::vector<RadiusKey> radius_profile = {};  ///< by rising `at_m`; empty: radius_m everywhere
};

struct PlaneShape {
  Eigen::Vector3d point_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = -Eigen::Vector3d::UnitZ();  ///< any length above 0; seen from both sides
};
struct BoxShape {
  Eigen::Vector3d center_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d size_m = Eigen::Vector3d::Ones();  ///< whole edge lengths
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
};
struct SphereShape {
  Eigen::Vector3d center_m = Eigen::Vector3d::Zero();
  double radius_m = 0.0;
};
struct CapsuleShape {
  Eigen::Vector3d from_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d to_m = Eigen::Vector3d::Zero();
  double radius_m = 0.0;
};
/// A closed cone or frustum; a radius may be 0, both ends are closed.
struct FrustumShape {
  Eigen::Vector3d from_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d to_m = Eigen::Vector3d::Zero();
  double from_radius_m = 0.0;
  double to_radius_m = 0.0;
};
/// Half of a thin spherical shell, seen inside and outside.
struct BowlShape {
  Eigen::Vector3d center_m = Eigen::Vector3d::Zero();   ///< middle of the rim
  Eigen::Vector3d opening = -Eigen::Vector3d::UnitY();  ///< where it opens to
  double radius_m = 0.0;
};

/// Anything in a scene that is no tube.
struct Solid {
  std::variant<PlaneShape, BoxShape, SphereShape, CapsuleShape, FrustumShape, BowlShape> shape;
  Motion motion;
};

/// The camera at one time. Keys are joined by a smooth (Catmull-Rom) path; before the first and after the last it
/// rests.
struct CameraKey {
  double time_s = 0.0;
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d look_at_m = Eigen::Vector3d::UnitZ();  ///< the image's down is the world's +y as near as it gets
};

struct Scene {
  std::string name;
  Intrinsics camera = {640, 480, 570.0, 570.0, 319.5, 239.5, {}};
  int frames = 30;
  double frames_per_second = 30.0;
  std::uint64_t seed = 1;
  std::vector<SceneTube> tubes;
  std::vector<Solid> solids;
  std::vector<CameraKey> camera_path;  ///< empty: the camera rests in the world's origin
};

/// To the microsecond, as devices tell it: a recording played as a device has the times of the recording.
double frame_time_s(const Scene& scene, int frame);

/// Identity when the scene has no camera path.
Eigen::Isometry3d world_from_camera(const Scene& scene, int frame);

/// Names the first field that cannot be right, as the scene file spells it (`tubes[0].parts[1].angle_rad: got …`).
Expected<void> validate(const Scene& scene);

/// The names that `preset_scene` knows, in the order of docs/scene.md.
std::span<const std::string_view> preset_names();

/// An unknown name lists the known ones.
Expected<Scene> preset_scene(std::string_view name);

/// Reads a scene file (docs/scene.md). Unknown keys, wrong types and impossible values name the file and the field.
Expected<Scene> read_scene_file(const std::filesystem::path& path);

/// A preset by its name, or a scene file where the name ends in .json.
Expected<Scene> load_scene(const std::string& preset_or_path);

}  // namespace tubetrack
