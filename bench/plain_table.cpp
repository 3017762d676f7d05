#include "plain_table.hpp"

#include <fmt/format.h>

#include <iterator>
#include <numbers>

#include "markdown.hpp"

namespace tubetrack::bench {

namespace {
constexpr double kDegrees = 180.0 / std::numbers::pi;
}  // namespace

std::string plain_header() {
  return fmt::format(
      "bias: mean signed error; near: toward the camera. in95: share of truth inside the 95 % interval. s/CRB: mean "
      "reported sigma over the Cramer-Rao bound. med, max: |radius error|\n"
      "{:30} |      centreline, mm | {:>6} {:>6} |          radius, mm        | in95 % {:>6} | s/CRB{:>5} | {:>5} "
      "{:>3} "
      "{:>3} | median ms (stages)\n"
      "{:30} | {:>6} {:>6} {:>6} | {:>6} {:>6} | {:>6} {:>6} {:>6} {:>5} | {:>6} {:>6} | {:>5} {:>4} | {:>5} {:>3} "
      "{:>3} "
      "| {:>6} ({:>5} {:>5} {:>5} {:>5} {:>5} {:>5})\n",
      "", "cover", "false", "", "", "", "", "", "row", "RMS", "near", "sigma", "%", "%", "med", "max", "bias", "med%",
      "line", "radius", "line", "rad", "IDF1", "sw", "tr", "frame", "upd", "nrm", "acc", "trc", "fit", "seg");
}

std::string plain_line(std::string_view row, std::string_view what, const Figures& f) {
  const Calibration& c = f.calibration;
  const auto radii_m = radius_errors_m(c);
  std::vector<double> sigmas;
  sigmas.reserve(c.nodes.size());
  for (const NodeError& node : c.nodes) sigmas.push_back(node.sigma_m);
  const StageTimes s = median_stages(f.stages);
  std::string text;
  auto out = std::back_inserter(text);
  fmt::format_to(out, "{:14} {:15} | {:>6} {:>6} {:>6} | {:>6} {:>6} ", row, fmt::format("{} ({})", what, f.frames),
                 number(1e3 * f.score.rms_m(), 3), bias(1e3 * c.toward_camera_m(), 3), number(1e3 * mean(sigmas), 3),
                 number(100.0 * f.score.coverage(), 1), number(100.0 * f.score.false_length(), 2));
  fmt::format_to(out, "| {:>6} {:>6} {:>6} {:>5} ", number(1e3 * median(radii_m), 3),
                 number(1e3 * quantile(radii_m, 1.0), 2), bias(1e3 * c.radius_error_m(), 3),
                 number(100.0 * median(radius_errors_relative(c)), 2));
  fmt::format_to(out, "| {:>6} {:>6} | {:>5} {:>4} ", number(100.0 * c.nodes_inside(), 1),
                 number(100.0 * c.radii_inside(), 1), number(mean(f.sigma_over_bound), 2),
                 number(mean(f.radius_sigma_over_bound), 2));
  fmt::format_to(out, "| {:>5} {:>3} {:>3} | {:>6} ({:>5} {:>5} {:>5} {:>5} {:>5} {:>5})\n", number(f.score.idf1(), 3),
                 f.score.switches, f.score.transfers, number(median(f.frame_ms), 1), number(s.update_ms, 1),
                 number(s.normals_ms, 1), number(s.accumulate_ms, 1), number(s.trace_ms, 1), number(s.fit_ms, 1),
                 number(s.segment_ms, 1));
  if (f.bends.tubes > 0) {
    fmt::format_to(out, "{:30} | bends: {} of {} tubes with the right number; medians {}°, {} % of the radius, {}°\n",
                   "", f.bends.tubes_right, f.bends.tubes, number(kDegrees * median(f.bends.angle_rad), 2),
                   number(100.0 * median(f.bends.bend_radius_relative), 2),
                   number(kDegrees * median(f.bends.rotation_rad), 2));
  }
  return text;
}

}  // namespace tubetrack::bench
