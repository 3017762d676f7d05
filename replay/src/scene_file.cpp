#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "tubetrack/replay/synthetic_scene.hpp"
#include "tubetrack/sensors/json_problem.hpp"

namespace tubetrack {

namespace {

using Json = nlohmann::json;
using Eigen::Vector3d;

// Stays within this file: read_scene_file turns it into an Error.
[[noreturn]] void refuse(const std::string& problem) {
  throw std::invalid_argument(problem);
}

/// One object of the file, and where it stands in it ("tubes[0].motion").
struct Field {
  const Json& json;
  std::string path;

  std::string name_of(const std::string& key) const { return path.empty() ? key : path + "." + key; }
  bool has(const std::string& key) const { return json.contains(key); }

  void expect_keys(std::initializer_list<const char*> known) const {
    if (!json.is_object()) refuse(fmt::format("{}: got {}, takes an object", path, json.dump()));
    for (const auto& item : json.items()) {
      if (std::find(known.begin(), known.end(), item.key()) != known.end()) continue;
      std::string list;
      for (const char* key : known) list += (list.empty() ? "" : ", ") + std::string(key);
      refuse(fmt::format("{}: unknown key, takes {}", name_of(item.key()), list));
    }
  }
  Field child(const std::string& key) const {
    if (!has(key)) refuse(fmt::format("{}: is missing", name_of(key)));
    return {json.at(key), name_of(key)};
  }
  Field element(std::size_t i) const { return {json.at(i), fmt::format("{}[{}]", path, i)}; }
  std::size_t array_size() const {
    if (!json.is_array()) refuse(fmt::format("{}: got {}, takes a list", path, json.dump()));
    return json.size();
  }

  double number() const {
    if (!json.is_number()) refuse(fmt::format("{}: got {}, takes a number", path, json.dump()));
    return json.get<double>();
  }
  template <int Size>
  Eigen::Matrix<double, Size, 1> numbers() const {
    if (!json.is_array() || json.size() != Size) {
      refuse(fmt::format("{}: got {}, takes a list of {} numbers", path, json.dump(), Size));
    }
    Eigen::Matrix<double, Size, 1> out;
    for (int i = 0; i < Size; ++i) out[i] = element(static_cast<std::size_t>(i)).number();
    return out;
  }
  template <class Integer>
  void read_integer(const std::string& key, Integer& value) const {
    if (!has(key)) return;
    const Json& got = json.at(key);
    // Anything that overflows an int is out of every range here; the seed alone uses all 64 bits.
    const bool fits =
        sizeof(Integer) == 8 ? got.is_number_unsigned() : got.is_number_integer() && std::abs(got.get<double>()) < 2e9;
    if (!fits) refuse(fmt::format("{}: got {}, takes a whole number", name_of(key), got.dump()));
    value = got.get<Integer>();
  }
  void read(const std::string& key, double& value) const {
    if (has(key)) value = child(key).number();
  }
  void read(const std::string& key, Vector3d& value) const {
    if (has(key)) value = child(key).numbers<3>();
  }
};

std::string text(const Field& field) {
  if (!field.json.is_string()) refuse(fmt::format("{}: got {}, takes a text", field.path, field.json.dump()));
  return field.json.get<std::string>();
}

Motion read_motion(const Field& field) {
  Motion motion;
  if (!field.has("motion")) return motion;
  const Field in = field.child("motion");
  in.expect_keys({"velocity_m_s", "angular_velocity_rad_s", "center_m"});
  in.read("velocity_m_s", motion.velocity_m_s);
  in.read("angular_velocity_rad_s", motion.angular_velocity_rad_s);
  in.read("center_m", motion.center_m);
  return motion;
}

TubePart read_part(const Field& in) {
  in.expect_keys({"type", "length_m", "bend_radius_m", "angle_rad", "rotation_rad"});
  const std::string type = text(in.child("type"));
  if (type == "straight") {
    in.expect_keys({"type", "length_m"});
    return TubePart::straight(in.child("length_m").number());
  }
  if (type != "arc") refuse(fmt::format("{}: got \"{}\", takes straight or arc", in.name_of("type"), type));
  in.expect_keys({"type", "bend_radius_m", "angle_rad", "rotation_rad"});
  TubePart part = TubePart::arc(in.child("bend_radius_m").number(), in.child("angle_rad").number());
  in.read("rotation_rad", part.rotation_rad);
  return part;
}

RadiusKey read_radius(const Field& in) {
  in.expect_keys({"at_m", "radius_m"});
  return {in.child("at_m").number(), in.child("radius_m").number()};
}

SceneTube read_tube(const Field& in) {
  in.expect_keys({"radius_m", "radius_profile", "start_m", "direction", "bend_direction", "parts", "motion"});
  SceneTube tube;
  if (in.has("radius_profile")) {
    if (in.has("radius_m")) refuse(fmt::format("{}: is given beside radius_profile; give one", in.name_of("radius_m")));
    const Field keys = in.child("radius_profile");
    for (std::size_t i = 0; i < keys.array_size(); ++i) tube.radius_profile.push_back(read_radius(keys.element(i)));
    if (tube.radius_profile.empty()) refuse(fmt::format("{}: is empty, takes a key or more", keys.path));
  } else {
    tube.radius_m = in.child("radius_m").number();
  }
  tube.start_m = in.child("start_m").numbers<3>();
  tube.direction = in.child("direction").numbers<3>();
  // A tube without bends needs no bend direction; any across it does.
  tube.bend_direction =
      tube.direction.allFinite() && tube.direction.norm() > 0.0 ? tube.direction.unitOrthogonal() : Vector3d::UnitY();
  const Field parts = in.child("parts");
  for (std::size_t i = 0; i < parts.array_size(); ++i) {
    tube.parts.push_back(read_part(parts.element(i)));
    if (tube.parts.back().type == TubePart::Type::arc) in.child("bend_direction");
  }
  in.read("bend_direction", tube.bend_direction);
  tube.motion = read_motion(in);
  return tube;
}

Solid read_solid(const Field& in) {
  in.expect_keys({"type", "point_m", "normal", "center_m", "size_m", "quaternion_xyzw", "radius_m", "from_m", "to_m",
                  "from_radius_m", "to_radius_m", "opening", "motion"});
  const std::string type = text(in.child("type"));
  const auto point = [&](const char* key) -> Vector3d { return in.child(key).numbers<3>(); };
  const auto number = [&](const char* key) { return in.child(key).number(); };
  Solid solid;
  solid.motion = read_motion(in);
  if (type == "plane") {
    in.expect_keys({"type", "motion", "point_m", "normal"});
    solid.shape = PlaneShape{point("point_m"), point("normal")};
  } else if (type == "box") {
    in.expect_keys({"type", "motion", "center_m", "size_m", "quaternion_xyzw"});
    BoxShape box{point("center_m"), point("size_m"), Eigen::Quaterniond::Identity()};
    if (in.has("quaternion_xyzw")) box.rotation.coeffs() = in.child("quaternion_xyzw").numbers<4>();
    solid.shape = box;
  } else if (type == "sphere") {
    in.expect_keys({"type", "motion", "center_m", "radius_m"});
    solid.shape = SphereShape{point("center_m"), number("radius_m")};
  } else if (type == "capsule") {
    in.expect_keys({"type", "motion", "from_m", "to_m", "radius_m"});
    solid.shape = CapsuleShape{point("from_m"), point("to_m"), number("radius_m")};
  } else if (type == "frustum") {
    in.expect_keys({"type", "motion", "from_m", "to_m", "from_radius_m", "to_radius_m"});
    solid.shape = FrustumShape{point("from_m"), point("to_m"), number("from_radius_m"), number("to_radius_m")};
  } else if (type == "bowl") {
    in.expect_keys({"type", "motion", "center_m", "opening", "radius_m"});
    solid.shape = BowlShape{point("center_m"), point("opening"), number("radius_m")};
  } else {
    refuse(fmt::format("{}: got \"{}\", takes plane, box, sphere, capsule, frustum or bowl", in.name_of("type"), type));
  }
  return solid;
}

CameraKey read_camera_key(const Field& in) {
  in.expect_keys({"time_s", "position_m", "look_at_m"});
  return {in.child("time_s").number(), in.child("position_m").numbers<3>(), in.child("look_at_m").numbers<3>()};
}

Intrinsics read_camera(const Field& in, Intrinsics camera) {
  in.expect_keys({"width", "height", "fx_px", "fy_px", "cx_px", "cy_px", "distortion"});
  in.read_integer("width", camera.width);
  in.read_integer("height", camera.height);
  in.read("fx_px", camera.fx_px);
  camera.fy_px = camera.fx_px;
  camera.cx_px = (camera.width - 1) / 2.0;
  camera.cy_px = (camera.height - 1) / 2.0;
  in.read("fy_px", camera.fy_px);
  in.read("cx_px", camera.cx_px);
  in.read("cy_px", camera.cy_px);
  if (in.has("distortion")) {
    const Field list = in.child("distortion");
    if (list.array_size() > camera.distortion.size()) {
      refuse(fmt::format("{}: got {} numbers, takes up to 8: k1 k2 p1 p2 k3 k4 k5 k6", list.path, list.array_size()));
    }
    for (std::size_t i = 0; i < list.array_size(); ++i) camera.distortion[i] = list.element(i).number();
  }
  return camera;
}

Scene read_scene(const Field& in) {
  if (!in.json.is_object()) refuse("the file takes one JSON object");
  in.expect_keys({"camera", "frames", "frames_per_second", "seed", "tubes", "solids", "camera_path"});
  Scene scene;
  if (in.has("camera")) scene.camera = read_camera(in.child("camera"), scene.camera);
  in.read_integer("frames", scene.frames);
  in.read("frames_per_second", scene.frames_per_second);
  in.read_integer("seed", scene.seed);
  const auto each = [&](const char* key, const auto& add) {
    if (!in.has(key)) return;
    const Field list = in.child(key);
    for (std::size_t i = 0; i < list.array_size(); ++i) add(list.element(i));
  };
  each("tubes", [&](const Field& tube) { scene.tubes.push_back(read_tube(tube)); });
  each("solids", [&](const Field& solid) { scene.solids.push_back(read_solid(solid)); });
  each("camera_path", [&](const Field& key) { scene.camera_path.push_back(read_camera_key(key)); });
  return scene;
}

}  // namespace

Expected<Scene> read_scene_file(const std::filesystem::path& path) {
  const auto failed = [&](const std::string& why) {
    return tl::make_unexpected(Error::usage(fmt::format("{}: {}", path.string(), why)));
  };
  std::ifstream file(path);
  if (!file) return failed("cannot be read; takes a scene file, see docs/scene.md");
  try {
    const Json json = Json::parse(file);
    Scene scene = read_scene({json, ""});
    scene.name = path.stem().string();
    if (auto valid = validate(scene); !valid) return failed(valid.error().message);
    return scene;
  } catch (const std::exception& problem) {
    return failed(json_problem(problem));
  }
}

Expected<Scene> load_scene(const std::string& preset_or_path) {
  const std::filesystem::path path(preset_or_path);
  return path.extension() == ".json" ? read_scene_file(path) : preset_scene(preset_or_path);
}

}  // namespace tubetrack
