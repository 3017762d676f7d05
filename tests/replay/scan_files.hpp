#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "recording_files.hpp"
#include "tubetrack/replay/scan_file.hpp"

namespace tubetrack::test {

/// A triangle mesh in the unit of whoever writes it.
struct TestMesh {
  std::vector<Eigen::Vector3d> points;
  std::vector<std::array<std::uint32_t, 3>> faces;  ///< counter-clockwise seen from outside
};

/// A piece of a torus' wall without ends: bend radius about the z axis, `turn_rad` of it, and of the section the
/// `section_rad` around its outermost line. A full turn and a full section are closed.
struct TorusPiece {
  double bend_radius = 60.0;
  double radius = 10.0;
  double turn_rad = 3.0;
  double section_rad = 6.283185307179586;
  int along = 120;
  int around = 48;
};
TestMesh tube_mesh(const TorusPiece& piece);

/// The outward normal at a point on or near the torus.
Eigen::Vector3d torus_normal(const TorusPiece& piece, const Eigen::Vector3d& point);

/// Points of a torus at random, without order, seeded.
std::vector<Eigen::Vector3d> torus_points(const TorusPiece& piece, int count, double noise, std::uint32_t seed);

std::string off_text(const TestMesh& mesh);
std::string obj_text(const TestMesh& mesh);
std::string ascii_stl(const TestMesh& mesh);
std::string binary_stl(const TestMesh& mesh, const std::string& title = "made by a test");
/// `format`: ascii, binary_little_endian or binary_big_endian.
std::string ply_bytes(const TestMesh& mesh, const std::string& format, bool with_double = false);

/// Numbers as bytes, least significant first unless told otherwise.
std::string float_bytes(float value, bool big_endian = false);
std::string uint32_bytes(std::uint32_t value, bool big_endian = false);
std::string uint16_bytes(std::uint16_t value);

/// A torus about the z axis, digitised: size voxels, 1 where the voxel's centre is inside.
std::string torus_voxels(int size_xy, int size_z, double bend_radius, double radius);

/// The bytes, deflated: `gzip` as in .nii.gz, else zlib as in .zraw.
std::string deflated(const std::string& bytes, bool gzip);

/// A NIfTI-1 header and its voxels of 8 bits; spacing in mm.
std::string nifti_bytes(std::array<int, 3> size, std::array<float, 3> spacing, const std::string& voxels);

void write_bytes(const std::filesystem::path& path, const std::string& bytes);

/// Reads a scan that must be readable; a failed expectation and an empty scan where it is not.
Scan scan_of(const std::filesystem::path& path, const ScanOptions& options = {});
/// The message of reading a scan that must not be readable; "" where it was.
std::string refusal_of(const std::filesystem::path& path, const ScanOptions& options = {});

}  // namespace tubetrack::test
