#include "tubetrack/replay/scan_file.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cctype>
#include <cmath>
#include <new>

#include "point_tree.hpp"
#include "scan_bytes.hpp"
#include "scan_content.hpp"
#include "scan_readers.hpp"
#include "scan_repair.hpp"

namespace tubetrack {

namespace {

struct SurfaceFormat {
  std::string_view extension;
  RawSurface (*read)(std::string_view bytes);
};
constexpr std::array<SurfaceFormat, 7> kSurfaceFormats = {{{".off", read_off},
                                                           {".obj", read_obj},
                                                           {".ply", read_ply},
                                                           {".stl", read_stl},
                                                           {".xyz", read_xyz},
                                                           {".txt", read_xyz},
                                                           {".pcd", read_pcd}}};
struct VolumeFormat {
  std::string_view ending;
  RawVolume (*read)(const std::filesystem::path& path, const ScanOptions& options);
};
constexpr std::array<VolumeFormat, 5> kVolumeFormats = {
    {{".vol", read_vol}, {".mhd", read_mhd}, {".mha", read_mhd}, {".nii", read_nifti}, {".nii.gz", read_nifti}}};
constexpr std::array<std::string_view, 4> kImageExtensions = {".png", ".pgm", ".tif", ".tiff"};

std::string lower_case(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

void check_options(const ScanOptions& options) {
  const auto check = [](const std::optional<double>& value, std::string_view flag, std::string_view takes,
                        bool positive) {
    if (!value || (std::isfinite(*value) && (!positive || *value > 0.0))) return;
    throw ScanRefusal{fmt::format("{} {:g}: takes {}", flag, *value, takes), Error::Kind::usage};
  };
  check(options.cell_size_m, "--cell-size", "metres, above 0, e.g. 0.0005", true);
  check(options.height_scale_m, "--height-scale", "metres per count, above 0, e.g. 0.00001", true);
  check(options.label, "--label", "a number", false);
  check(options.threshold, "--threshold", "a number", false);
}

double metres_of(std::optional<ScanUnit> unit, double otherwise) {
  if (!unit) return otherwise;
  return *unit == ScanUnit::metre ? 1.0 : kMetresPerMillimetre;
}

constexpr double kFarthest_m = 1e9;

/// Points of a cloud may be NaN (no return); a mesh's corners may not. Nothing may lie where squares lose their digits.
void refuse_bad_points(const RawSurface& raw, double metres_per_unit) {
  const auto refuse = [](std::string_view where, std::size_t i, const Eigen::Vector3d& point, std::string_view takes) {
    throw ScanRefusal{
        fmt::format("{}point {} (counted from 0) is ({:g}, {:g}, {:g}), takes {}; repair or export it again", where, i,
                    point.x(), point.y(), point.z(), takes)};
  };
  for (std::size_t i = 0; i < raw.points.size(); ++i) {
    const double farthest = raw.points[i].cwiseAbs().maxCoeff<Eigen::PropagateNumbers>() * metres_per_unit;
    if (std::isfinite(farthest) && farthest > kFarthest_m) refuse("", i, raw.points[i], "coordinates below 1e9 m");
  }
  for (std::size_t i = 0; i < raw.faces.size(); ++i) {
    for (const std::uint32_t corner : raw.faces[i]) {
      if (!raw.points[corner].allFinite())
        refuse(fmt::format("triangle {}: its ", i), corner, raw.points[corner], "finite numbers");
    }
  }
}

/// Coordinates of a georeferenced scan lose their last digits in `float`, which surfels have: such a scan is moved.
void move_near_zero(Scan& scan) {
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3d& point : scan.points_m) {
    if (point.allFinite()) box.extend(point);
  }
  if (box.isEmpty()) return;
  constexpr double kFarInDiagonals = 30.0;  // a float's 24 bits still leave a diagonal 19 of its own
  const double farthest = box.min().cwiseAbs().cwiseMax(box.max().cwiseAbs()).maxCoeff();
  if (farthest <= kFarInDiagonals * box.diagonal().norm()) return;
  scan.origin_m = box.center();
  for (Eigen::Vector3d& point : scan.points_m) point -= scan.origin_m;
  scan.notes.push_back(fmt::format("coordinates are large: moved by ({:.4f}, {:.4f}, {:.4f}) m", -scan.origin_m.x(),
                                   -scan.origin_m.y(), -scan.origin_m.z()));
}

void note_unlikely_size(Scan& scan, bool unit_given) {
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3d& point : scan.points_m) box.extend(point);
  const double across_m = box.diagonal().norm();
  constexpr double kLeast_m = 0.02, kMost_m = 200.0;
  if (unit_given || (across_m >= kLeast_m && across_m <= kMost_m)) return;
  scan.notes.push_back(
      fmt::format("the scan is {:.3g} m across with millimetres assumed; if that is wrong, give --unit", across_m));
}

Scan scan_of_surface(RawSurface raw, const ScanOptions& options) {
  if (raw.points.empty()) throw ScanRefusal{"has no points; copy or export it again"};
  Scan scan;
  scan.kind = raw.faces.empty() ? ScanKind::cloud : ScanKind::mesh;
  scan.metres_per_unit = metres_of(options.unit, kMetresPerMillimetre);
  refuse_bad_points(raw, scan.metres_per_unit);
  scan.notes = std::move(raw.notes);
  scan.points_m = std::move(raw.points);
  scan.faces = std::move(raw.faces);
  for (Eigen::Vector3d& point : scan.points_m) point *= scan.metres_per_unit;
  if (scan.kind == ScanKind::mesh) {
    clean_mesh(scan);
    if (scan.faces.empty()) throw ScanRefusal{"none of its faces has an area; export it again"};
    move_near_zero(scan);
    scan.grid_step_m = default_grid_step_m(scan);
    orient_mesh(scan, scan.grid_step_m);
  } else {
    scan.normals = std::move(raw.normals);
    clean_cloud(scan);
    constexpr std::size_t kFewestPoints = 3;
    if (scan.points_m.size() < kFewestPoints) {
      throw ScanRefusal{fmt::format("has {} different finite points, takes at least {}; export it again",
                                    scan.points_m.size(), kFewestPoints)};
    }
    move_near_zero(scan);
    scan.grid_step_m = default_grid_step_m(scan);
    std::optional<Eigen::Vector3d> viewpoint_m;
    if (raw.viewpoint) viewpoint_m = *raw.viewpoint * scan.metres_per_unit - scan.origin_m;
    orient_cloud(scan, viewpoint_m, scan.grid_step_m);
  }
  note_unlikely_size(scan, options.unit.has_value());
  return scan;
}

Scan scan_of_volume(RawVolume raw, const ScanOptions& options) {
  Scan scan;
  scan.kind = ScanKind::voxels;
  scan.notes = std::move(raw.notes);
  scan.voxels = std::move(raw.grid);
  VoxelGrid& grid = scan.voxels;
  if (options.cell_size_m || options.unit == ScanUnit::voxel || !raw.metres_per_unit) {
    const double edge_m = options.cell_size_m.value_or(kMetresPerMillimetre);
    scan.metres_per_unit = edge_m;
    grid.origin_m.setZero();
    // The header's axes still say which way each runs.
    for (int axis = 0; axis < 3; ++axis) grid.axes_m.col(axis) = edge_m * grid.axes_m.col(axis).normalized();
    if (!options.cell_size_m && options.unit != ScanUnit::voxel)
      scan.notes.emplace_back("the header has no voxel size: 1 mm assumed; if that is wrong, give --cell-size");
  } else {
    scan.metres_per_unit = metres_of(options.unit, raw.metres_per_unit.value_or(kMetresPerMillimetre));
    grid.origin_m *= scan.metres_per_unit;
    grid.axes_m *= scan.metres_per_unit;
  }
  scan.grid_step_m = default_grid_step_m(scan);
  return scan;
}

Scan read_as_named(const std::filesystem::path& path, const ScanOptions& options) {
  check_options(options);
  std::error_code error;
  if (!std::filesystem::exists(path, error)) throw ScanRefusal{"no such file; check the path", Error::Kind::usage};
  if (std::filesystem::is_directory(path, error)) {
    throw ScanRefusal{"is a folder, takes a scan's file; for a recording there is `tubetrack replay`",
                      Error::Kind::usage};
  }
  if (!std::filesystem::is_regular_file(path, error)) throw ScanRefusal{"is no regular file; copy it to one"};
  if (std::filesystem::file_size(path, error) == 0 && !error)
    throw ScanRefusal{"is empty (0 bytes); copy or export it again"};
  const std::string name = lower_case(path.filename().string());
  for (const VolumeFormat& format : kVolumeFormats) {
    if (name.ends_with(format.ending)) return scan_of_volume(format.read(path, options), options);
  }
  for (const SurfaceFormat& format : kSurfaceFormats) {
    if (!name.ends_with(format.extension)) continue;
    const std::size_t limit =
        options.memory_limit_bytes != 0 ? options.memory_limit_bytes : default_memory_limit_bytes();
    return scan_of_surface(format.read(read_whole_file(path, limit)), options);
  }
  for (const std::string_view extension : kImageExtensions) {
    if (!name.ends_with(extension)) continue;
    return read_height_image(path, options);
  }
  throw ScanRefusal{
      fmt::format("extension {}: takes a mesh (.off .obj .ply .stl), a cloud (.xyz .txt .ply .pcd), voxels "
                  "(.vol .mhd .mha .nii .nii.gz) or a 16-bit height map (.png .pgm .tif .tiff)",
                  in_quotes(path.extension().string())),
      Error::Kind::usage};
}

/// A file that can't be read as what it is named may be something else by what is in it: then that is what is wrong.
Scan read_any(const std::filesystem::path& path, const ScanOptions& options) {
  try {
    return read_as_named(path, options);
  } catch (const ScanRefusal& refusal) {
    const std::string_view ending = ending_by_content(read_header_text(path));
    if (ending.empty() || has_ending(lower_case(path.filename().string()), ending)) throw;
    throw ScanRefusal{fmt::format("is named {} but begins as {} does; rename it", path.extension().string(), ending),
                      refusal.kind};
  }
}

double median(std::vector<double>& values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

double mesh_step_m(const Scan& scan) {
  std::vector<double> longest, shortest;
  for (const auto& [a, b, c] : scan.faces) {
    const double ab = (scan.points_m[a] - scan.points_m[b]).norm(), bc = (scan.points_m[b] - scan.points_m[c]).norm(),
                 ca = (scan.points_m[c] - scan.points_m[a]).norm();
    longest.push_back(std::max({ab, bc, ca}));
    shortest.push_back(std::min({ab, bc, ca}));
  }
  constexpr double kSliver = 5.0;
  const double longest_m = median(longest), shortest_m = median(shortest);
  return longest_m > kSliver * shortest_m ? shortest_m : longest_m;
}

double cloud_step_m(const Scan& scan) {
  if (scan.points_m.size() < 2) return 0.0;
  constexpr std::size_t kMostSamples = 100'000;
  const std::size_t stride = (scan.points_m.size() + kMostSamples - 1) / kMostSamples;
  const PointTree tree(scan.points_m);
  std::vector<Neighbour> near;
  std::vector<double> distances;
  for (std::size_t i = 0; i < scan.points_m.size(); i += stride) {
    tree.nearest(scan.points_m[i], 2, near);
    distances.push_back(std::sqrt(near.back().squared_distance));
  }
  return median(distances);
}

}  // namespace

Expected<Scan> read_scan(const std::filesystem::path& path, const ScanOptions& options) {
  try {
    return read_any(path, options);
  } catch (const ScanRefusal& refusal) {
    return tl::make_unexpected(Error{refusal.kind, path.string() + ": " + refusal.text});
  } catch (const std::bad_alloc&) {
    return tl::make_unexpected(
        Error::failed(path.string() + ": takes more memory than there is; make it coarser or cut it up"));
  } catch (const std::exception& error) {  // the file system's and OpenCV's
    return tl::make_unexpected(Error::failed(fmt::format("{}: cannot be read: {}", path.string(), error.what())));
  }
}

double default_grid_step_m(const Scan& scan) {
  switch (scan.kind) {
    case ScanKind::mesh:
      return mesh_step_m(scan);
    case ScanKind::cloud:
      return cloud_step_m(scan);
    case ScanKind::voxels:
      // Voxels may be longer one way than the others: the edge of the cube of the same volume.
      return std::cbrt(std::abs(scan.voxels.axes_m.determinant()));
    default:
      return scan.heights.cell_size_m;
  }
}

}  // namespace tubetrack
