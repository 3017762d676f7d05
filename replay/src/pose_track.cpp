#include "pose_track.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "text_lines.hpp"

namespace tubetrack {

namespace {

std::optional<std::array<double, 8>> parse_eight(std::string_view text) {
  std::array<double, 8> values{};
  for (double& value : values) {
    const auto number = parse_number(take_word(text));
    if (!number) return std::nullopt;
    value = *number;
  }
  if (!text.empty()) return std::nullopt;
  return values;
}

Eigen::Isometry3d isometry(const StampedPose& pose) {
  Eigen::Isometry3d result = Eigen::Isometry3d::Identity();
  result.linear() = pose.rotation.toRotationMatrix();
  result.translation() = pose.translation_m;
  return result;
}

}  // namespace

Expected<std::vector<StampedPose>> read_pose_track(const std::filesystem::path& path) {
  const auto lines = read_text_lines(path);
  if (!lines) return tl::make_unexpected(lines.error());
  std::vector<StampedPose> track;
  for (const TextLine& line : *lines) {
    const auto v = parse_eight(line.text);
    if (!v && line.unfinished) break;
    if (!v) {
      return tl::make_unexpected(
          Error::failed(fmt::format("{}:{}: got \"{}\", takes 8 numbers: timestamp tx ty tz qx qy qz qw", path.string(),
                                    line.number, line.text)));
    }
    const auto& [t, tx, ty, tz, qx, qy, qz, qw] = *v;
    const Eigen::Quaterniond rotation(qw, qx, qy, qz);
    // Files carry three or more decimals; what is farther from unit length is no rotation but columns mixed up.
    if (std::abs(rotation.norm() - 1.0) > 0.01) {
      return tl::make_unexpected(Error::failed(
          fmt::format("{}:{}: qx qy qz qw: got length {:g}, takes a unit quaternion (check the column order)",
                      path.string(), line.number, rotation.norm())));
    }
    track.push_back({t, {tx, ty, tz}, rotation.normalized()});
  }
  if (track.empty()) {
    return tl::make_unexpected(
        Error::failed(fmt::format("{}: no poses in it; take the file away for a camera at rest", path.string())));
  }
  std::stable_sort(track.begin(), track.end(),
                   [](const auto& a, const auto& b) { return a.timestamp_s < b.timestamp_s; });
  return track;
}

std::optional<Eigen::Isometry3d> pose_at(std::span<const StampedPose> track, double timestamp_s) {
  // Stamps are seconds since 1970 in a double: a microsecond is what they can be trusted to.
  const auto near = [&](const StampedPose& pose) {
    return std::abs(pose.timestamp_s - timestamp_s) <= kPoseLimit_s + 1e-6;
  };
  const auto after = std::lower_bound(track.begin(), track.end(), timestamp_s,
                                      [](const StampedPose& pose, double t) { return pose.timestamp_s < t; });
  const bool has_after = after != track.end();
  const bool has_before = after != track.begin();
  if (has_after && after->timestamp_s == timestamp_s) return isometry(*after);
  if (has_after && !has_before) return near(*after) ? std::optional(isometry(*after)) : std::nullopt;
  if (!has_before) return std::nullopt;
  const StampedPose& before = *std::prev(after);
  if (!has_after) return near(before) ? std::optional(isometry(before)) : std::nullopt;
  if (!near(before) && !near(*after)) return std::nullopt;
  const double part = (timestamp_s - before.timestamp_s) / (after->timestamp_s - before.timestamp_s);
  return isometry({timestamp_s, before.translation_m + part * (after->translation_m - before.translation_m),
                   before.rotation.slerp(part, after->rotation).normalized()});
}

}  // namespace tubetrack
