#include "scan_flags.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <initializer_list>
#include <utility>

#include "flag_values.hpp"

namespace tubetrack {

namespace {

/// Reads a flag that holds one number above 0 into `value`, if it was given.
Expected<void> read_length(std::string_view flag, const std::string& text, std::string_view form,
                           std::optional<double>& value) {
  if (text.empty()) return {};
  value = number_from<double>(text);
  if (!value || *value <= 0.0) return malformed(flag, text, form);
  return {};
}

Expected<void> read_value(std::string_view flag, const std::string& text, std::optional<double>& value) {
  if (text.empty()) return {};
  value = number_from<double>(text);
  if (!value) return malformed(flag, text, "a number, like 1");
  return {};
}

}  // namespace

void add_scan_flags(CLI::App& command, ScanFlags& flags) {
  const auto option = [&](const char* name, std::string& value, const char* what, const char* type) {
    command.add_option(name, value, what)->type_name(type);
  };
  command.add_option("FILE", flags.file, "the scan")->required();
  option("--unit", flags.unit, "what a length of 1 in the file is; mm for meshes and clouds, volumes' headers say it",
         "mm|m|voxel");
  option("--radius", flags.radius, "the tubes' radius in metres, where it is known; found if left out", "M");
  option("--radius-range", flags.radius_range, "look for radii in this range only, in metres", "MIN:MAX");
  option("--grid-step", flags.grid_step,
         "grid step of the votes, in metres; if left out, by the radius and how dense the scan is", "M");
  option("--label", flags.label, "voxels: those of this value are the body", "N");
  option("--threshold", flags.threshold, "voxels: those of this value and above are the body", "T");
  option("--cell-size", flags.cell_size, "metres a cell of a height map, or a voxel, in place of the header's", "M");
  option("--height-scale", flags.height_scale, "metres per count of a height map", "S");
  option("--normals", flags.normals,
         "voxels, height maps: smooth (if left out) or vcm, the Voronoi covariance measure of the paper", "smooth|vcm");
  add_nominal_flags(command, flags.nominal);
  option("--out", flags.out, "write the result here instead of to stdout", "FILE");
  add_scan_output_flags(command, flags.outputs);
  command.add_flag("--no-timing", flags.no_timing, "leave times out of the result: equal scans give equal bytes");
  command.add_flag("--quiet", flags.quiet, "no summary on stderr, errors only");
}

Expected<ScanOptions> scan_options_from(const ScanFlags& flags) {
  ScanOptions options;
  if (flags.unit == "mm") {
    options.unit = ScanUnit::millimetre;
  } else if (flags.unit == "m") {
    options.unit = ScanUnit::metre;
  } else if (flags.unit == "voxel") {
    options.unit = ScanUnit::voxel;
  } else if (!flags.unit.empty()) {
    return malformed("--unit", flags.unit, "mm, m or voxel");
  }
  const std::initializer_list<Expected<void>> checks{
      read_length("--cell-size", flags.cell_size, "metres, above 0, like 0.0005", options.cell_size_m),
      read_length("--height-scale", flags.height_scale, "metres per count, above 0, like 0.00001",
                  options.height_scale_m),
      read_value("--label", flags.label, options.label), read_value("--threshold", flags.threshold, options.threshold)};
  for (const Expected<void>& check : checks) {
    if (!check) return tl::make_unexpected(check.error());
  }
  return options;
}

Expected<void> apply_radius(const ScanFlags& flags, ScanTubesConfig& config) {
  if (!flags.radius.empty() && !flags.radius_range.empty())
    return tl::make_unexpected(Error::usage("--radius and --radius-range: give one of the two"));
  if (auto read =
          read_length("--radius", flags.radius, "the tubes' radius in metres, above 0, like 0.02", config.radius_m);
      !read)
    return read;
  if (flags.radius_range.empty()) return {};
  const auto range = numbers_from<double, 2>(flags.radius_range, ':');
  if (!range || (*range)[0] <= 0.0 || (*range)[1] <= (*range)[0])
    return malformed("--radius-range", flags.radius_range, "MIN:MAX in metres, 0 < MIN < MAX, like 0.01:0.03");
  config.radius_min_m = (*range)[0];
  config.radius_max_m = (*range)[1];
  return {};
}

Expected<std::optional<double>> grid_step_from(const ScanFlags& flags) {
  std::optional<double> step_m;
  if (auto read = read_length("--grid-step", flags.grid_step, "metres, above 0, like 0.001", step_m); !read)
    return tl::make_unexpected(read.error());
  return step_m;
}

Expected<GridNormals> normals_from(const ScanFlags& flags) {
  if (flags.normals.empty() || flags.normals == "smooth") return GridNormals::smoothed;
  if (flags.normals == "vcm") return GridNormals::voronoi;
  return malformed("--normals", flags.normals, "smooth or vcm");
}

Expected<void> check_flags_fit(const ScanFlags& flags, ScanKind kind) {
  const bool voxels = kind == ScanKind::voxels, heights = kind == ScanKind::height_map;
  struct Rule {
    const char* flag;
    const std::string& value;
    bool fits;
    const char* of;
  };
  const Rule rules[] = {{"--label", flags.label, voxels, "voxels"},
                        {"--threshold", flags.threshold, voxels, "voxels"},
                        {"--cell-size", flags.cell_size, voxels || heights, "voxels and height maps"},
                        {"--normals", flags.normals, voxels || heights, "voxels and height maps"},
                        {"--height-scale", flags.height_scale, heights, "height maps"},
                        {"--unit", flags.unit, !heights, "meshes, clouds and voxels"}};
  for (const Rule& rule : rules) {
    if (rule.value.empty() || rule.fits) continue;
    const std::string_view article = voxels ? "" : "a ";
    return tl::make_unexpected(Error::usage(fmt::format("{} {}: does nothing for {}{}, only for {}; leave it out",
                                                        rule.flag, rule.value, article, name_of(kind), rule.of)));
  }
  return {};
}

Expected<void> check_lengths_fit(const ScanFlags& flags, const ScanTubesConfig& config,
                                 std::span<const ScanSurfel> surfels) {
  Eigen::AlignedBox3f box;
  for (const ScanSurfel& surfel : surfels) box.extend(surfel.position_m);
  if (box.isEmpty()) return {};
  // A tube that is seen over a quarter of its section and is 1.5 radii long is two radii from corner to corner.
  const double half_m = 0.5 * static_cast<double>(box.diagonal().norm());
  struct Length {
    const char* flag;
    const std::string& text;
    double value_m;
  };
  const Length lengths[] = {{"--radius", flags.radius, config.radius_m.value_or(0.0)},
                            {"--radius-range", flags.radius_range, config.radius_min_m},
                            {"--grid-step", flags.grid_step, config.cell_m.value_or(0.0)}};
  for (const auto& [flag, text, value_m] : lengths) {
    if (text.empty() || value_m <= half_m) continue;
    return tl::make_unexpected(Error::usage(
        fmt::format("{} {}: {:g} m is too large for a scan of {:.3g} m from corner to corner; takes metres, at most "
                    "half of that: is it in millimetres?",
                    flag, text, value_m, 2.0 * half_m)));
  }
  return {};
}

std::string_view name_of(ScanKind kind) {
  switch (kind) {
    case ScanKind::mesh:
      return "mesh";
    case ScanKind::cloud:
      return "point cloud";
    case ScanKind::voxels:
      return "voxels";
    default:
      return "height map";
  }
}

}  // namespace tubetrack
