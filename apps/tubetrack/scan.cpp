#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <utility>

#include "commands.hpp"
#include "nominal_check.hpp"
#include "run.hpp"
#include "scan_flags.hpp"
#include "scan_outputs.hpp"
#include "scan_result.hpp"
#include "tubetrack/replay/scan_surfels.hpp"
#include "tubetrack/report/scan_json.hpp"
#include "tubetrack/tracker/joints.hpp"
#include "tubetrack/tracker/scan_tubes.hpp"

namespace tubetrack {

namespace {

constexpr const char* kScanFooter =
    R"(FILE is a mesh (.off .obj .ply .stl), a point cloud (.xyz .txt .ply .pcd), voxels (.vol .mhd .mha .nii .nii.gz) or a
16-bit height map (.png .pgm .tif .tiff; with --cell-size and --height-scale, unless `tubetrack replay --map plane
--save-heightmap` wrote it: then a .json beside it says them). Meshes and clouds are taken to be in
millimetres; --unit says otherwise. No other flag is needed: the radius is found. Results are in metres.

The result is one line of JSON (docs/output.schema.json): every tube with its centreline, radius, straight and toric
parts and, where it has no free part, its bend table. The summary on stderr says the same for people.

Examples:
  tubetrack scan pipe.stl
  tubetrack scan post.pcd --unit m --out post.jsonl
  tubetrack scan aorta.nii.gz --radius-range 0.01:0.03
  tubetrack scan pipe.stl --lra bends.csv --error-map errors.ply --picture pipe.png
  tubetrack scan pipe.stl --step pipe.step
  tubetrack scan relief.png --cell-size 0.0005 --height-scale 0.00001
  tubetrack scan pipe.stl --nominal pipe.csv --tolerance 0.5

Exit codes: 0 done; 1 unreadable, no tube in it, or out of tolerance; 2 wrong usage. docs/scans.md has more.)";

/// How large the file was and in which unit it was taken to be.
void print_scan(const ScanFlags& flags, const Scan& scan, double own_step_m, std::size_t surfels, double seconds) {
  fmt::print(stderr, "{}: {}", flags.file, name_of(scan.kind));
  if (scan.kind == ScanKind::mesh) fmt::print(stderr, ", {} faces", scan.faces.size());
  if (scan.kind == ScanKind::cloud) fmt::print(stderr, ", {} points", scan.points_m.size());
  if (scan.kind == ScanKind::voxels) fmt::print(stderr, ", {} boundary faces", surfels);
  if (scan.kind == ScanKind::height_map) fmt::print(stderr, ", {} cells with a height", surfels);
  const bool surface = scan.kind == ScanKind::mesh || scan.kind == ScanKind::cloud;
  if (surface && flags.unit.empty()) {
    fmt::print(stderr, "; unit: mm (assumed)");
  } else if (scan.kind != ScanKind::height_map) {
    fmt::print(stderr, "; unit: {:g} m", scan.metres_per_unit);
  }
  fmt::print(stderr, "; grid step {:.4g} mm; read in {:.2f} s\n", 1e3 * scan.grid_step_m, seconds);
  for (const std::string& note : scan.notes) fmt::print(stderr, "note: {}\n", note);
  constexpr double kMuchFiner = 4.0;
  if (kMuchFiner * scan.grid_step_m < own_step_m)
    fmt::print(stderr, "note: --grid-step {}: finer than the scan's own {:.3g} m; the search takes much longer\n",
               flags.grid_step, own_step_m);
}

void print_joints(std::span<const TubeJoint> joints) {
  for (const TubeJoint& joint : joints) {
    std::string parts;
    for (const TubeJoint::Part& part : joint.parts)
      parts += fmt::format("{}tube {} ({})", parts.empty() ? "" : ", ", part.tube, joint_part_name(part.at));
    fmt::print(stderr, "joint: {}\n", parts);
  }
}

/// Why a scan without a tube has none, as far as that can be told.
Error no_tube(const ScanFlags& flags, const ScanTubesConfig& config) {
  const std::string radii = config.radius_m ? fmt::format("{:.4g}", *config.radius_m)
                                            : fmt::format("{:.4g} to {:.4g}", config.radius_min_m, config.radius_max_m);
  return Error::failed(fmt::format("{}: no tube of radius {} m found; {}", flags.file, radii,
                                   config.radius_m || !flags.radius_range.empty()
                                       ? "radii are in metres, whatever --unit says; leave it out to look for all"
                                       : "check --unit, or give --radius-range"));
}

void print_found(const ScanFlags& flags, const TubeFrame& frame, std::span<const TubeJoint> joints) {
  print_tubes(frame.tubes);
  print_joints(joints);
  fmt::print(stderr, "{} tube(s) in {:.2f} s\n", frame.tubes.size(), 1e-3 * frame.latency_ms);
  const bool table = std::ranges::any_of(frame.tubes, [](const Tube& tube) { return !tube.bend_table.lra.empty(); });
  if (!table && !(flags.outputs.lra.empty() && flags.outputs.xyz.empty()))
    fmt::print(stderr,
               "note: --xyz, --lra: no tube has a bend table; each has a part that is neither straight nor toric\n");
}

Expected<void> write_line(const std::string& line, const std::string& path) {
  if (!path.empty()) return write_text_file("--out", path, line + "\n");
  fmt::print("{}\n", line);
  return {};
}

Expected<void> run_scan(const ScanFlags& flags) {
  const auto options = scan_options_from(flags);
  if (!options) return tl::make_unexpected(options.error());
  ScanTubesConfig config;
  if (auto applied = apply_radius(flags, config); !applied) return applied;
  const auto normals = normals_from(flags);
  if (!normals) return tl::make_unexpected(normals.error());
  const auto asked_step_m = grid_step_from(flags);
  if (!asked_step_m) return tl::make_unexpected(asked_step_m.error());
  const std::optional<double> step_m = *asked_step_m;
  if (auto checked = check_scan_outputs(flags.outputs, flags.out, flags.file, flags.nominal.nominal); !checked)
    return checked;
  const auto nominal = nominal_check_from(flags.nominal, flags.out);
  if (!nominal) return tl::make_unexpected(nominal.error());
  const auto begin = std::chrono::steady_clock::now();
  Scan scan;
  if (auto read = read_scan(flags.file, *options)) {
    scan = std::move(*read);
  } else {
    return tl::make_unexpected(read.error());
  }
  if (auto fit = check_flags_fit(flags, scan.kind); !fit) return fit;
  const double own_step_m = std::exchange(scan.grid_step_m, step_m.value_or(scan.grid_step_m));
  ScanSurfelOptions surfel_options;
  surfel_options.normals = *normals;
  const std::vector<ScanSurfel> surfels = surfels_of(scan, surfel_options);
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
  if (!flags.quiet) print_scan(flags, scan, own_step_m, surfels.size(), seconds.count());
  config.cell_m = step_m;
  if (auto fit = check_lengths_fit(flags, config, surfels); !fit) return fit;
  TubeFrame frame;
  if (auto found = tubes_of_scan(scan, surfels, config, flags.radius_range.empty() && !config.radius_m)) {
    frame = std::move(*found);
  } else {
    return tl::make_unexpected(found.error());
  }
  const std::vector<TubeJoint> joints = joints_of(frame.tubes);
  const std::vector<NominalComparison> compared = compare_with_nominal(nominal->tubes, frame.tubes);
  const std::string line = line_with_findings(frame, !flags.no_timing, {joints, compared, nominal->tolerance_m});
  if (auto written = write_line(line, flags.out); !written) return written;
  if (!flags.quiet && !frame.tubes.empty()) print_found(flags, frame, joints);
  // Without a tube as well, or those of an earlier run would be taken for this one's.
  if (auto written = write_scan_outputs(flags.outputs, scan, surfels, frame.tubes); !written) return written;
  if (frame.tubes.empty()) return tl::make_unexpected(no_tube(flags, config));
  if (!flags.quiet) print_nominal(compared);
  return judge_nominal(flags.file, compared, nominal->tolerance_m);
}

}  // namespace

void add_scan(CLI::App& app, int& exit_code) {
  auto flags = std::make_shared<ScanFlags>();
  CLI::App* command = app.add_subcommand("scan", "find the tubes of a static scan: mesh, cloud, voxels, height map");
  command->footer(kScanFooter);
  add_scan_flags(*command, *flags);
  command->callback([flags, &exit_code] {
    const auto done = run_scan(*flags);
    exit_code = done ? 0 : report_error(done.error());
  });
}

}  // namespace tubetrack
