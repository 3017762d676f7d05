#include <fmt/format.h>

#include <Eigen/Geometry>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <iterator>

#include "tubetrack/report/surface_mesh.hpp"

namespace tubetrack {

namespace {

std::string ply_text(const SurfaceMesh& mesh) {
  std::string text = fmt::format(
      "ply\nformat ascii 1.0\ncomment metres\nelement vertex {}\nproperty float x\nproperty float y\nproperty float "
      "z\n",
      mesh.points_m.size());
  if (!mesh.colors.empty()) text += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  if (!mesh.distance_m.empty()) text += "property float distance\n";
  text += fmt::format("element face {}\nproperty list uchar int vertex_indices\nend_header\n", mesh.faces.size());
  auto out = std::back_inserter(text);
  for (std::size_t i = 0; i < mesh.points_m.size(); ++i) {
    const Eigen::Vector3d& p = mesh.points_m[i];
    fmt::format_to(out, "{:.7g} {:.7g} {:.7g}", p.x(), p.y(), p.z());
    if (!mesh.colors.empty()) fmt::format_to(out, " {} {} {}", mesh.colors[i][0], mesh.colors[i][1], mesh.colors[i][2]);
    if (!mesh.distance_m.empty()) fmt::format_to(out, " {:.4g}", mesh.distance_m[i]);
    text += '\n';
  }
  for (const auto& [a, b, c] : mesh.faces) fmt::format_to(out, "3 {} {} {}\n", a, b, c);
  return text;
}

std::string obj_text(const SurfaceMesh& mesh) {
  std::string text = "# metres\n";
  auto out = std::back_inserter(text);
  for (const Eigen::Vector3d& p : mesh.points_m) fmt::format_to(out, "v {:.7g} {:.7g} {:.7g}\n", p.x(), p.y(), p.z());
  for (const auto& [a, b, c] : mesh.faces) fmt::format_to(out, "f {} {} {}\n", a + 1, b + 1, c + 1);
  return text;
}

/// Little-endian, as the machines are that this runs on.
template <class Number>
void put(std::string& bytes, Number number) {
  char raw[sizeof(Number)];
  std::memcpy(raw, &number, sizeof(Number));
  bytes.append(raw, sizeof(Number));
}

std::string stl_bytes(const SurfaceMesh& mesh) {
  constexpr std::size_t kHeader = 80;
  std::string bytes = "tubetrack, metres";
  bytes.resize(kHeader, ' ');
  put(bytes, static_cast<std::uint32_t>(mesh.faces.size()));
  for (const auto& [a, b, c] : mesh.faces) {
    const Eigen::Vector3d corners[] = {mesh.points_m[a], mesh.points_m[b], mesh.points_m[c]};
    const Eigen::Vector3d normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalized();
    for (int axis = 0; axis < 3; ++axis) put(bytes, static_cast<float>(normal[axis]));
    for (const Eigen::Vector3d& corner : corners) {
      for (int axis = 0; axis < 3; ++axis) put(bytes, static_cast<float>(corner[axis]));
    }
    put(bytes, std::uint16_t{0});
  }
  return bytes;
}

}  // namespace

Expected<void> write_mesh(const std::filesystem::path& path, const SurfaceMesh& mesh) {
  const std::string extension = path.extension().string();
  std::string bytes;
  if (extension == ".ply") {
    bytes = ply_text(mesh);
  } else if (extension == ".obj") {
    bytes = obj_text(mesh);
  } else if (extension == ".stl") {
    bytes = stl_bytes(mesh);
  } else {
    return tl::make_unexpected(
        Error::usage(fmt::format("{}: extension '{}': takes .ply, .obj or .stl", path.string(), extension)));
  }
  std::ofstream file(path, std::ios::binary);
  if (!file) {
    return tl::make_unexpected(
        Error::usage(fmt::format("{}: {}; give a file in an existing folder", path.string(), std::strerror(errno))));
  }
  file << bytes << std::flush;
  if (!file) return tl::make_unexpected(Error::failed(fmt::format("{}: {}", path.string(), std::strerror(errno))));
  return {};
}

}  // namespace tubetrack
