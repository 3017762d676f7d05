#include "scan_outputs.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <system_error>
#include <tuple>
#include <vector>

#include "flag_values.hpp"
#include "tubetrack/report/result_json.hpp"
#include "tubetrack/report/scan_picture.hpp"
#include "tubetrack/report/surface_mesh.hpp"
#include "tubetrack/report/tube_tables.hpp"
#include "tubetrack/sensors/child_process.hpp"

namespace tubetrack {

namespace {

constexpr const char* kStepProgram = "tubetrack_step";

/// The input as it is drawn and compared: a mesh's own faces, else the surfels' places.
SurfaceMesh surface_of_scan(const Scan& scan, std::span<const ScanSurfel> surfels) {
  SurfaceMesh mesh;
  if (scan.kind == ScanKind::mesh) {
    mesh.points_m = scan.points_m;
    mesh.faces = scan.faces;
  } else {
    for (const ScanSurfel& surfel : surfels) mesh.points_m.emplace_back(surfel.position_m.cast<double>());
  }
  for (Eigen::Vector3d& point : mesh.points_m) point = scan.pose * (point + scan.origin_m);
  return mesh;
}

Expected<void> write_tables(const ScanOutputs& outputs, std::span<const Tube> tubes) {
  using Table = std::string (*)(std::span<const Tube>);
  const std::tuple<const char*, const std::string*, Table> tables[] = {
      {"--centerline", &outputs.centerline, centerline_csv},
      {"--xyz", &outputs.xyz, xyz_csv},
      {"--lra", &outputs.lra, lra_csv},
      {"--vtk", &outputs.vtk, vtk_polydata}};
  for (const auto& [flag, path, table] : tables) {
    if (path->empty()) continue;
    if (auto written = write_text_file(flag, *path, table(tubes)); !written) return written;
  }
  return {};
}

/// By the program beside this one, which says in lines what it left out, and at last that it is done or why not.
Expected<void> write_step_file(const std::string& path, std::span<const Tube> tubes) {
  if (path.empty()) return {};
  if (tubes.empty()) {
    std::error_code ignored;
    if (std::filesystem::exists(path, ignored))
      fmt::print(stderr, "note: --step {}: there is no tube to write, it is as it was\n", path);
    return {};
  }
  const auto program = ChildProcess::start(kStepProgram, {path});
  if (!program) return tl::make_unexpected(program.error());
  TubeFrame frame;
  frame.tubes.assign(tubes.begin(), tubes.end());
  const std::string line = result_line(frame, false) + "\n";
  std::string said;
  if (program->send(line.data(), line.size())) {
    for (char byte = 0; program->receive(&byte, 1);) said += byte;
  }
  std::istringstream lines(said);
  std::string last;
  for (std::string next; std::getline(lines, next); last = next) {
    if (next.starts_with("note: ")) fmt::print(stderr, "{}\n", next);
  }
  if (last == "written") return {};
  return tl::make_unexpected(
      Error::failed(fmt::format("--step {}", last.empty() ? path + ": " + kStepProgram + " broke down" : last)));
}

/// The tubes' surface, the input coloured by its distance to it, and a picture of both.
Expected<void> write_surfaces(const ScanOutputs& outputs, const Scan& scan, std::span<const ScanSurfel> surfels,
                              std::span<const Tube> tubes) {
  if (outputs.mesh.empty() && outputs.error_map.empty() && outputs.picture.empty()) return {};
  SurfaceMesh surfaces[2];
  surfaces[0] = surface_of_scan(scan, surfels);
  for (const Tube& tube : tubes) append(surfaces[1], surface_of(tube));
  if (!outputs.mesh.empty()) {
    if (auto written = write_mesh(outputs.mesh, surfaces[1]); !written) return written;
  }
  const SurfaceErrors errors = color_by_distance(surfaces[0], tubes);
  if (!outputs.error_map.empty()) {
    if (auto written = write_mesh(outputs.error_map, surfaces[0]); !written) return written;
    if (errors.on_tubes > 0) {
      fmt::print(
          stderr, "distance of {} points from the tubes: min {:.4f}, median {:.4f}, 95 % {:.4f}, max {:.4f} mm; ",
          errors.on_tubes, 1e3 * errors.min_m, 1e3 * errors.median_m, 1e3 * errors.percentile_95_m, 1e3 * errors.max_m);
    }
    fmt::print(stderr, "{} points belong to no tube\n", errors.off_tubes);
  }
  if (outputs.picture.empty()) return {};
  return write_scan_picture(outputs.picture, surfaces);
}

}  // namespace

Expected<void> write_text_file(std::string_view flag, const std::string& path, const std::string& text) {
  std::ofstream file(path);
  if (!file) {
    return tl::make_unexpected(
        Error::usage(fmt::format("{} {}: {}; give a file in an existing folder", flag, path, std::strerror(errno))));
  }
  file << text << std::flush;
  if (!file) return tl::make_unexpected(Error::failed(fmt::format("{} {}: {}", flag, path, std::strerror(errno))));
  return {};
}

void add_scan_output_flags(CLI::App& command, ScanOutputs& outputs) {
  const auto option = [&](const char* name, std::string& value, const char* what, const char* type) {
    command.add_option(name, value, what)->type_name(type);
  };
  option("--centerline", outputs.centerline, "the centrelines' nodes as CSV", "FILE.csv");
  option("--xyz", outputs.xyz, "the bend tables' points as CSV", "FILE.csv");
  option("--lra", outputs.lra, "the bend tables' lengths, rotations and angles as CSV", "FILE.csv");
  option("--vtk", outputs.vtk, "the centrelines as VTK polydata", "FILE.vtk");
  option("--mesh", outputs.mesh, "the tubes' surface, by the name's extension PLY, OBJ or STL", "FILE");
  option("--step", outputs.step, "the tubes as solids for CAD: cylinders and tori, in millimetres", "FILE.step");
  option("--error-map", outputs.error_map, "the input coloured by its distance to the tubes; prints a summary of it",
         "FILE.ply");
  option("--picture", outputs.picture, "a picture of the input coloured so, and of the tubes beside it", "FILE.png");
}

Expected<void> check_scan_outputs(const ScanOutputs& outputs, const std::string& out, const std::string& input,
                                  const std::string& nominal) {
  namespace fs = std::filesystem;
  struct Output {
    const char* flag;
    const std::string& path;
    std::vector<std::string_view> extensions;  // empty: any
  };
  const Output all[] = {{"--out", out, {}},
                        {"--centerline", outputs.centerline, {".csv"}},
                        {"--xyz", outputs.xyz, {".csv"}},
                        {"--lra", outputs.lra, {".csv"}},
                        {"--vtk", outputs.vtk, {".vtk"}},
                        {"--mesh", outputs.mesh, {".ply", ".obj", ".stl"}},
                        {"--step", outputs.step, {".step", ".stp"}},
                        {"--error-map", outputs.error_map, {".ply"}},
                        {"--picture", outputs.picture, {".png"}}};
  std::error_code ignored;
  std::map<fs::path, const char*> taken{{fs::weakly_canonical(input, ignored), "the scan itself"}};
  if (!nominal.empty()) taken.emplace(fs::weakly_canonical(nominal, ignored), "what --nominal reads");
  for (const auto& [flag, path, extensions] : all) {
    if (path.empty()) continue;
    const fs::path file = fs::weakly_canonical(path, ignored);
    if (!extensions.empty() && std::ranges::find(extensions, file.extension().string()) == extensions.end())
      return malformed(flag, path, fmt::format("a name that ends in {}", fmt::join(extensions, ", ")));
    if (!fs::is_directory(fs::absolute(file, ignored).parent_path(), ignored) || fs::is_directory(file, ignored))
      return malformed(flag, path, "a file in an existing folder");
    const auto [other, fresh] = taken.emplace(file, flag);
    if (fresh || path == "/dev/null") continue;
    return tl::make_unexpected(
        Error::usage(fmt::format("{} {}: is {} too; give another name", flag, path, other->second)));
  }
  if (!outputs.step.empty() && ChildProcess::beside_us(kStepProgram).empty()) {
    return tl::make_unexpected(Error::failed(
        "--step: this tubetrack was built without OpenCASCADE; install libocct-data-exchange-dev and build again"));
  }
  return {};
}

Expected<void> write_scan_outputs(const ScanOutputs& outputs, const Scan& scan, std::span<const ScanSurfel> surfels,
                                  std::span<const Tube> tubes) {
  if (auto written = write_tables(outputs, tubes); !written) return written;
  if (auto written = write_surfaces(outputs, scan, surfels, tubes); !written) return written;
  return write_step_file(outputs.step, tubes);  // last, as some tubes make no solid
}

}  // namespace tubetrack
