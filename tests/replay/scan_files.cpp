#include "scan_files.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <fstream>
#include <numbers>
#include <random>

namespace tubetrack::test {

namespace {

constexpr double kFullTurn = 2.0 * std::numbers::pi;

template <class T>
std::string bytes_of(T value, bool big_endian) {
  std::string bytes(sizeof(T), '\0');
  std::memcpy(bytes.data(), &value, sizeof(T));
  if (big_endian != (std::endian::native == std::endian::big)) std::reverse(bytes.begin(), bytes.end());
  return bytes;
}

Eigen::Vector3d torus_point(const TorusPiece& piece, double turn, double section, double radius) {
  const Eigen::Vector3d out(std::cos(turn), std::sin(turn), 0.0);
  return piece.bend_radius * out + radius * (std::cos(section) * out + std::sin(section) * Eigen::Vector3d::UnitZ());
}

}  // namespace

TestMesh tube_mesh(const TorusPiece& piece) {
  const bool ring = piece.turn_rad > kFullTurn - 1e-9, full = piece.section_rad > kFullTurn - 1e-9;
  const int rows = ring ? piece.along : piece.along + 1, columns = full ? piece.around : piece.around + 1;
  TestMesh mesh;
  for (int i = 0; i < rows; ++i) {
    for (int j = 0; j < columns; ++j) {
      const double section = piece.section_rad * (static_cast<double>(j) / piece.around - 0.5);
      mesh.points.push_back(torus_point(piece, piece.turn_rad * i / piece.along, section, piece.radius));
    }
  }
  const auto at = [&](int i, int j) { return static_cast<std::uint32_t>(i % rows * columns + j % columns); };
  for (int i = 0; i < piece.along; ++i) {
    for (int j = 0; j < piece.around; ++j) {
      mesh.faces.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      mesh.faces.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  }
  return mesh;
}

Eigen::Vector3d torus_normal(const TorusPiece& piece, const Eigen::Vector3d& point) {
  const Eigen::Vector3d out = Eigen::Vector3d(point.x(), point.y(), 0.0).normalized();
  return (point - piece.bend_radius * out).normalized();
}

std::vector<Eigen::Vector3d> torus_points(const TorusPiece& piece, int count, double noise, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  std::normal_distribution<double> normal(0.0, 1.0);
  std::vector<Eigen::Vector3d> points;
  while (static_cast<int>(points.size()) < count) {
    const double section = piece.section_rad * (uniform(random) - 0.5);
    const double turn = piece.turn_rad * uniform(random);
    // Even over the area: the outside of the bend has more of it.
    const double reach = piece.bend_radius + piece.radius * std::cos(section);
    if (uniform(random) * (piece.bend_radius + piece.radius) > reach) continue;
    points.push_back(torus_point(piece, turn, section, piece.radius + noise * normal(random)));
  }
  return points;
}

std::string off_text(const TestMesh& mesh) {
  std::string text = fmt::format("OFF\n# a comment\n{} {} 0\n", mesh.points.size(), mesh.faces.size());
  for (const auto& p : mesh.points) text += fmt::format("{} {} {}\n", p.x(), p.y(), p.z());
  for (const auto& [a, b, c] : mesh.faces) text += fmt::format("3 {} {} {}\n", a, b, c);
  return text;
}

std::string obj_text(const TestMesh& mesh) {
  std::string text = "# made by a test\no tube\n";
  for (const auto& p : mesh.points) text += fmt::format("v {} {} {}\n", p.x(), p.y(), p.z());
  text += "vn 0 0 1\nvt 0 0\n";
  const auto count = static_cast<long>(mesh.points.size());
  for (std::size_t i = 0; i < mesh.faces.size(); ++i) {
    const auto& [a, b, c] = mesh.faces[i];
    if (i % 3 == 0) text += fmt::format("f {} {} {}\n", a + 1, b + 1, c + 1);
    if (i % 3 == 1) text += fmt::format("f {}/1/1 {}//1 {}/1\n", a + 1, b + 1, c + 1);
    if (i % 3 == 2) text += fmt::format("f {} {} {}\n", a - count, b - count, c - count);
  }
  return text;
}

std::string ascii_stl(const TestMesh& mesh) {
  std::string text = "solid tube\n";
  for (const auto& face : mesh.faces) {
    text += "facet normal 0 0 0\n outer loop\n";
    for (const std::uint32_t corner : face) {
      const Eigen::Vector3d& p = mesh.points[corner];
      text += fmt::format("  vertex {:e} {:e} {:e}\n", p.x(), p.y(), p.z());
    }
    text += " endloop\nendfacet\n";
  }
  return text + "endsolid tube\n";
}

std::string binary_stl(const TestMesh& mesh, const std::string& title) {
  std::string bytes = title;
  bytes.resize(80, ' ');
  bytes += uint32_bytes(static_cast<std::uint32_t>(mesh.faces.size()));
  for (const auto& face : mesh.faces) {
    bytes += std::string(12, '\0');
    for (const std::uint32_t corner : face) {
      for (const double x : mesh.points[corner]) bytes += float_bytes(static_cast<float>(x));
    }
    bytes += std::string(2, '\0');
  }
  return bytes;
}

std::string ply_bytes(const TestMesh& mesh, const std::string& format, bool with_double) {
  const bool ascii = format == "ascii", big = format == "binary_big_endian";
  const std::string real = with_double ? "double" : "float";
  std::string bytes = fmt::format(
      "ply\nformat {} 1.0\ncomment made by a test\nelement vertex {}\nproperty uchar red\nproperty {} x\nproperty {} "
      "y\nproperty {} z\nelement face {}\nproperty list uchar int vertex_indices\nproperty short flags\nend_header\n",
      format, mesh.points.size(), real, real, real, mesh.faces.size());
  for (const auto& p : mesh.points) {
    if (ascii) bytes += fmt::format("255 {} {} {}\n", p.x(), p.y(), p.z());
    if (ascii) continue;
    bytes += '\xff';
    for (const double x : p) bytes += with_double ? bytes_of(x, big) : float_bytes(static_cast<float>(x), big);
  }
  for (const auto& face : mesh.faces) {
    if (ascii) bytes += fmt::format("3 {} {} {} 7\n", face[0], face[1], face[2]);
    if (ascii) continue;
    bytes += '\x03';
    for (const std::uint32_t corner : face) bytes += uint32_bytes(corner, big);
    bytes += std::string(2, '\0');
  }
  return bytes;
}

std::string float_bytes(float value, bool big_endian) {
  return bytes_of(value, big_endian);
}
std::string uint32_bytes(std::uint32_t value, bool big_endian) {
  return bytes_of(value, big_endian);
}
std::string uint16_bytes(std::uint16_t value) {
  return bytes_of(value, false);
}

std::string torus_voxels(int size_xy, int size_z, double bend_radius, double radius) {
  std::string voxels;
  for (int k = 0; k < size_z; ++k) {
    for (int j = 0; j < size_xy; ++j) {
      for (int i = 0; i < size_xy; ++i) {
        const double x = i - 0.5 * (size_xy - 1), y = j - 0.5 * (size_xy - 1), z = k - 0.5 * (size_z - 1);
        voxels += std::hypot(std::hypot(x, y) - bend_radius, z) < radius ? '\x01' : '\0';
      }
    }
  }
  return voxels;
}

std::string deflated(const std::string& bytes, bool gzip) {
  z_stream stream{};
  if (deflateInit2(&stream, 6, Z_DEFLATED, gzip ? 31 : 15, 8, Z_DEFAULT_STRATEGY) != Z_OK) return {};
  std::string result(deflateBound(&stream, bytes.size()) + 64, '\0');
  std::string input = bytes;
  stream.next_in = reinterpret_cast<Bytef*>(input.data());
  stream.avail_in = static_cast<uInt>(input.size());
  stream.next_out = reinterpret_cast<Bytef*>(result.data());
  stream.avail_out = static_cast<uInt>(result.size());
  deflate(&stream, Z_FINISH);
  result.resize(stream.total_out);
  deflateEnd(&stream);
  return result;
}

std::string nifti_bytes(std::array<int, 3> size, std::array<float, 3> spacing, const std::string& voxels) {
  std::string header(352, '\0');
  const auto put = [&](std::size_t place, const std::string& bytes) { header.replace(place, bytes.size(), bytes); };
  put(0, uint32_bytes(348));
  put(40, uint16_bytes(3));
  for (std::size_t k = 0; k < 3; ++k) {
    put(42 + 2 * k, uint16_bytes(static_cast<std::uint16_t>(size[k])));
    put(80 + 4 * k, float_bytes(spacing[k]));
  }
  for (std::size_t k = 3; k < 7; ++k) put(42 + 2 * k, uint16_bytes(1));
  put(70, uint16_bytes(2));
  put(72, uint16_bytes(8));
  put(108, float_bytes(352.0F));
  put(123, "\x02");
  put(344, std::string("n+1\0", 4));
  return header + voxels;
}

void write_bytes(const std::filesystem::path& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

Scan scan_of(const std::filesystem::path& path, const ScanOptions& options) {
  auto scan = read_scan(path, options);
  EXPECT_TRUE(scan.has_value()) << scan.error().message;
  return scan ? *std::move(scan) : Scan{};
}

std::string refusal_of(const std::filesystem::path& path, const ScanOptions& options) {
  const auto scan = read_scan(path, options);
  EXPECT_FALSE(scan.has_value());
  if (scan) return {};
  EXPECT_EQ(scan.error().message.find('\n'), std::string::npos) << scan.error().message;
  EXPECT_EQ(scan.error().message.find(path.string()), 0U) << scan.error().message;
  return scan.error().message;
}

}  // namespace tubetrack::test
