#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <bit>
#include <cmath>

#include "scan_bytes.hpp"
#include "scan_readers.hpp"
#include "scan_repair.hpp"

namespace tubetrack {

namespace {

std::uint64_t hash_of(const Eigen::Vector3d& point) {
  std::uint64_t hash = 0;
  for (const double coordinate : point) {
    hash ^= std::bit_cast<std::uint64_t>(coordinate + 0.0);  // −0 and 0 are equal
    hash *= 0x9E3779B97F4A7C15U;
    hash ^= hash >> 29U;
  }
  return hash;
}

bool has_area(const Scan& scan, const std::array<std::uint32_t, 3>& face) {
  const auto& [a, b, c] = face;
  if (a == b || b == c || c == a) return false;
  const Eigen::Vector3d ab = scan.points_m[b] - scan.points_m[a], ac = scan.points_m[c] - scan.points_m[a];
  // The sine of the angle at a: below this a face's normal is what rounding made of it.
  constexpr double kLeastSine = 1e-9;
  return ab.cross(ac).norm() > kLeastSine * ab.norm() * ac.norm();
}

/// Of faces with the same three corners, in whatever order, the first stays.
std::size_t drop_repeated_faces(std::vector<std::array<std::uint32_t, 3>>& faces) {
  struct Key {
    std::array<std::uint32_t, 3> corners;
    std::uint32_t face;
    auto operator<=>(const Key&) const = default;
  };
  std::vector<Key> keys;
  keys.reserve(faces.size());
  for (std::size_t i = 0; i < faces.size(); ++i) {
    auto corners = faces[i];
    std::sort(corners.begin(), corners.end());
    keys.push_back({corners, static_cast<std::uint32_t>(i)});
  }
  std::sort(keys.begin(), keys.end());
  std::size_t dropped = 0;
  for (std::size_t i = 1; i < keys.size(); ++i) {
    if (keys[i].corners != keys[i - 1].corners) continue;
    faces[keys[i].face] = {kNone, kNone, kNone};
    ++dropped;
  }
  std::erase_if(faces, [](const auto& face) { return face[0] == kNone; });
  return dropped;
}

std::size_t drop_unused_points(Scan& scan) {
  std::vector<std::uint32_t> place(scan.points_m.size(), kNone);
  for (const auto& face : scan.faces) {
    for (const std::uint32_t corner : face) place[corner] = 0;
  }
  std::uint32_t kept = 0;
  for (std::size_t i = 0; i < place.size(); ++i) {
    if (place[i] == kNone) continue;
    scan.points_m[kept] = scan.points_m[i];
    place[i] = kept++;
  }
  for (auto& face : scan.faces) {
    for (std::uint32_t& corner : face) corner = place[corner];
  }
  const std::size_t dropped = scan.points_m.size() - kept;
  scan.points_m.resize(kept);
  return dropped;
}

}  // namespace

std::vector<std::uint32_t> merge_equal_points(std::vector<Eigen::Vector3d>& points) {
  std::vector<std::uint32_t> slots(std::bit_ceil(2 * points.size() + 1), kNone);
  std::vector<std::uint32_t> place(points.size());
  std::uint32_t kept = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d point = points[i];
    std::size_t slot = hash_of(point) & (slots.size() - 1);
    while (slots[slot] != kNone && points[slots[slot]] != point) slot = (slot + 1) & (slots.size() - 1);
    if (slots[slot] == kNone) {
      slots[slot] = kept;
      points[kept++] = point;
    }
    place[i] = slots[slot];
  }
  points.resize(kept);
  return place;
}

void clean_mesh(Scan& scan) {
  const std::size_t points_before = scan.points_m.size(), faces_before = scan.faces.size();
  std::size_t unused = drop_unused_points(scan);
  const std::size_t points_used = scan.points_m.size();
  const auto place = merge_equal_points(scan.points_m);
  for (auto& face : scan.faces) {
    for (std::uint32_t& corner : face) corner = place[corner];
  }
  const std::size_t merged = points_used - scan.points_m.size();
  std::erase_if(scan.faces, [&](const auto& face) { return !has_area(scan, face); });
  const std::size_t flat = faces_before - scan.faces.size();
  const std::size_t repeated = drop_repeated_faces(scan.faces);
  unused += drop_unused_points(scan);
  if (merged != 0)
    scan.notes.push_back(fmt::format("{} of {} points repeat another one: merged", merged, points_before));
  if (flat != 0) scan.notes.push_back(fmt::format("{} of {} faces have no area: dropped", flat, faces_before));
  if (repeated != 0)
    scan.notes.push_back(fmt::format("{} of {} faces are there twice: dropped", repeated, faces_before));
  if (unused != 0)
    scan.notes.push_back(fmt::format("{} of {} points belong to no face: dropped", unused, points_before));
}

void add_polygon(RawSurface& surface, std::span<const long long> corners, std::string_view what, long long number) {
  const auto point_count = static_cast<long long>(surface.points.size());
  for (const long long corner : corners) {
    if (corner >= 0 && corner < point_count) continue;
    throw ScanRefusal{
        fmt::format("{} {}: corner: got point {} (counted from 0), there are {}; correct the face or export "
                    "it again",
                    what, number, corner, point_count)};
  }
  for (std::size_t k = 2; k < corners.size(); ++k) {
    surface.faces.push_back({static_cast<std::uint32_t>(corners[0]), static_cast<std::uint32_t>(corners[k - 1]),
                             static_cast<std::uint32_t>(corners[k])});
  }
}

}  // namespace tubetrack
