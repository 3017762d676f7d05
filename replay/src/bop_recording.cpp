#include <fmt/format.h>

#include <Eigen/LU>
#include <array>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>

#include "recorded_sequence.hpp"
#include "refusal.hpp"
#include "text_lines.hpp"
#include "tubetrack/sensors/json_problem.hpp"

namespace tubetrack {

namespace {

constexpr double kMetresPerMillimetre = 0.001;

template <std::size_t N>
std::array<double, N> numbers(const nlohmann::json& entry, const std::string& key) {
  const auto found = entry.find(key);
  if (found == entry.end() || !found->is_array() || found->size() != N) {
    throw Refusal{
        fmt::format("{}: got {}, takes {} numbers", key, found == entry.end() ? "nothing" : found->dump(), N)};
  }
  std::array<double, N> values{};
  for (std::size_t i = 0; i < N; ++i) {
    if (!(*found)[i].is_number())
      throw Refusal{fmt::format("{}[{}]: got {}, takes a number", key, i, (*found)[i].dump())};
    values[i] = (*found)[i].template get<double>();
  }
  return values;
}

CameraInfo camera_of(const nlohmann::json& entry) {
  CameraInfo camera;
  const auto k = numbers<9>(entry, "cam_K");
  camera.intrinsics.fx_px = k[0];
  camera.intrinsics.cx_px = k[2];
  camera.intrinsics.fy_px = k[4];
  camera.intrinsics.cy_px = k[5];
  if (const auto scale = entry.find("depth_scale"); scale != entry.end()) {
    if (!scale->is_number()) throw Refusal{fmt::format("depth_scale: got {}, takes mm per unit", scale->dump())};
    camera.metres_per_unit = scale->get<double>() * kMetresPerMillimetre;
  }
  return camera;
}

/// The file holds camera_from_world; we want its inverse.
std::optional<Eigen::Isometry3d> pose_of(const nlohmann::json& entry) {
  if (!entry.contains("cam_R_w2c") && !entry.contains("cam_t_w2c")) return std::nullopt;
  const auto r = numbers<9>(entry, "cam_R_w2c");
  const auto t = numbers<3>(entry, "cam_t_w2c");
  const Eigen::Matrix3d rotation = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(r.data());
  if (!((rotation * rotation.transpose()).isIdentity(1e-3) && rotation.determinant() > 0.0)) {
    throw Refusal{
        fmt::format("cam_R_w2c: got determinant {:g}, takes a rotation matrix by rows", rotation.determinant())};
  }
  Eigen::Isometry3d camera_from_world = Eigen::Isometry3d::Identity();
  camera_from_world.linear() = Eigen::Quaterniond(rotation).normalized().toRotationMatrix();
  camera_from_world.translation() = Eigen::Map<const Eigen::Vector3d>(t.data()) * kMetresPerMillimetre;
  return camera_from_world.inverse();
}

/// One camera for the whole scene: the stages size their tables once.
void require_same(const CameraInfo& a, const CameraInfo& b) {
  const auto& p = a.intrinsics;
  const auto& q = b.intrinsics;
  if (p.fx_px != q.fx_px || p.fy_px != q.fy_px || p.cx_px != q.cx_px || p.cy_px != q.cy_px) {
    throw Refusal{
        fmt::format("cam_K: got fx,fy,cx,cy {:g},{:g},{:g},{:g} after {:g},{:g},{:g},{:g}; takes one camera "
                    "for all images: split the scene",
                    q.fx_px, q.fy_px, q.cx_px, q.cy_px, p.fx_px, p.fy_px, p.cx_px, p.cy_px)};
  }
  if (a.metres_per_unit != b.metres_per_unit) {
    throw Refusal{"depth_scale: differs from the images before; takes one scale for all images: split the scene"};
  }
}

std::filesystem::path image_path(const std::filesystem::path& folder, long id) {
  const std::filesystem::path png = folder / "depth" / fmt::format("{:06d}.png", id);
  const std::filesystem::path tif = folder / "depth" / fmt::format("{:06d}.tif", id);
  std::error_code ignored;
  return !std::filesystem::exists(png, ignored) && std::filesystem::exists(tif, ignored) ? tif : png;
}

/// The keys are image numbers as text; the frames come in the order of the numbers.
std::map<long, nlohmann::json> entries_of(const nlohmann::json& root) {
  if (!root.is_object() || root.empty()) throw Refusal{"takes an object with one entry an image, and at least one"};
  std::map<long, nlohmann::json> entries;
  for (const auto& [key, entry] : root.items()) {
    const auto id = parse_number(key);
    if (!id || *id < 0 || *id > 999999999 || !entry.is_object()) {
      throw Refusal{fmt::format("got key \"{}\", takes image numbers with an object each", key)};
    }
    entries[static_cast<long>(*id)] = entry;
  }
  return entries;
}

void read_entries(const nlohmann::json& root, RecordedSequence& sequence) {
  for (const auto& [id, entry] : entries_of(root)) try {
      const CameraInfo camera = camera_of(entry);
      if (!sequence.camera) sequence.camera = camera;
      require_same(*sequence.camera, camera);
      const auto pose = pose_of(entry);
      sequence.has_poses = sequence.has_poses || pose.has_value();
      const double timestamp_s = static_cast<double>(sequence.frames.size()) / kAssumedFramesPerSecond;
      sequence.frames.push_back({image_path(sequence.path, id), timestamp_s, pose,
                                 fmt::format("{}: image {}", sequence.camera_file.string(), id)});
    } catch (const Refusal& refusal) {
      throw Refusal{fmt::format("image {}: {}", id, refusal.text)};
    }
}

}  // namespace

Expected<RecordedSequence> read_bop_recording(const std::filesystem::path& folder) {
  RecordedSequence sequence;
  sequence.path = folder;
  sequence.camera_file = folder / "scene_camera.json";
  const auto failed = [&](const std::string& why) {
    return tl::make_unexpected(Error::failed(fmt::format("{}: {}", sequence.camera_file.string(), why)));
  };
  std::ifstream file(sequence.camera_file);
  if (!file) return failed("cannot be opened; check that it is there and readable");
  try {
    read_entries(nlohmann::json::parse(file), sequence);
  } catch (const Refusal& refusal) {
    return failed(refusal.text);
  } catch (const nlohmann::json::parse_error& error) {
    return failed(fmt::format("no JSON (stops at byte {}); copy it again", error.byte));
  } catch (const std::exception& error) {
    return failed(json_problem(error));
  }
  sequence.notes.push_back(
      fmt::format("{}: no timestamps, {:g} frames a second assumed", folder.string(), kAssumedFramesPerSecond));
  return sequence;
}

}  // namespace tubetrack
