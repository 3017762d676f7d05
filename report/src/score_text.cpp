#include <fmt/format.h>

#include <cmath>
#include <iterator>
#include <nlohmann/json.hpp>
#include <numbers>

#include "tubetrack/report/score.hpp"

namespace tubetrack {

namespace {

constexpr double kDegrees = 180.0 / std::numbers::pi;

std::string number(double value, int digits) {
  return std::isfinite(value) ? fmt::format("{:.{}f}", value, digits) : "-";
}

nlohmann::ordered_json number_json(double value) {
  if (!std::isfinite(value)) return nullptr;
  return std::round(value * 1e7) / 1e7;
}

nlohmann::ordered_json tube_json(const TubeScore& t) {
  return {{"frames_in_view", t.frames_in_view},
          {"frames_found", t.frames_found},
          {"coverage", number_json(t.coverage())},
          {"rms_m", number_json(t.rms_m())},
          {"false_length", number_json(t.false_length())},
          {"reported_m", number_json(t.reported_m)},
          {"radius_error_median", number_json(t.radius_error_median())},
          {"inside_95", number_json(t.inside_95())},
          {"idf1", number_json(t.idf1())},
          {"switches", t.switches},
          {"transfers", t.transfers}};
}

nlohmann::ordered_json bends_json(const BendErrors& bends) {
  return {{"tubes", bends.tubes},
          {"tubes_right", bends.tubes_right},
          {"angle_error_median_rad", number_json(median(bends.angle_rad))},
          {"bend_radius_error_median", number_json(median(bends.bend_radius_relative))},
          {"rotation_error_median_rad", number_json(median(bends.rotation_rad))}};
}

}  // namespace

std::string score_table(const Score& score) {
  std::string text;
  auto out = std::back_inserter(text);
  fmt::format_to(out, "{:>5} {:>9} {:>7} {:>11} {:>7} {:>14} {:>15} {:>13} {:>6} {:>9} {:>10}\n", "tube", "radius mm",
                 "frames", "coverage %", "RMS mm", "false length %", "radius error %", "in interval %", "IDF1",
                 "switches", "transfers");
  const auto row = [&](const std::string& name, const std::string& radius, const TubeScore& t) {
    fmt::format_to(out, "{:>5} {:>9} {:>7} {:>11} {:>7} {:>14} {:>15} {:>13} {:>6} {:>9} {:>10}\n", name, radius,
                   t.frames_in_view, number(100.0 * t.coverage(), 2), number(1e3 * t.rms_m(), 3),
                   number(100.0 * t.false_length(), 2), number(100.0 * t.radius_error_median(), 2),
                   number(100.0 * t.inside_95(), 1), number(t.idf1(), 3), t.switches, t.transfers);
  };
  for (const TubeScore& tube : score.tubes) {
    row(fmt::format("{}", tube.id), number(1e3 * tube.true_radius_m, 2), tube);
  }
  row("all", "", score.total);
  fmt::format_to(out, "{} frames scored", score.frames_scored);
  if (score.frames_bad > 0) fmt::format_to(out, ", {} bad", score.frames_bad);
  if (score.frames_not_run > 0) fmt::format_to(out, ", {} without a result", score.frames_not_run);
  if (score.frames_without_truth > 0) fmt::format_to(out, ", {} results without truth", score.frames_without_truth);
  fmt::format_to(out, "; {:.2f} m of centreline reported, {:.2f} m false\n", score.total.reported_m,
                 score.total.false_m);
  if (score.total.reported_m > 0.0 && score.total.false_m >= score.total.reported_m)
    text += "no reported tube lies at a true one: are these the results of this recording, in its frame?\n";
  const BendErrors& bends = score.bends;
  if (bends.tubes > 0) {
    fmt::format_to(out,
                   "bends: as many as there are on {} of {} tubes; of these angle {}° off, bend radius {} %, "
                   "rotation {}° (medians; bends of 45–150°, 2.5 diameters and 60 mm of arc or more)\n",
                   bends.tubes_right, bends.tubes, number(kDegrees * median(bends.angle_rad), 2),
                   number(100.0 * median(bends.bend_radius_relative), 2),
                   number(kDegrees * median(bends.rotation_rad), 2));
  }
  return text;
}

std::string score_json(const Score& score) {
  nlohmann::ordered_json json{
      {"frames_scored", score.frames_scored},    {"frames_bad", score.frames_bad},
      {"frames_not_run", score.frames_not_run},  {"frames_without_truth", score.frames_without_truth},
      {"total", tube_json(score.total)},         {"bends", bends_json(score.bends)},
      {"tubes", nlohmann::ordered_json::array()}};
  for (const TubeScore& tube : score.tubes) {
    nlohmann::ordered_json row{{"id", tube.id}, {"radius_m", number_json(tube.true_radius_m)}};
    row.update(tube_json(tube));
    json["tubes"].push_back(std::move(row));
  }
  return json.dump();
}

}  // namespace tubetrack
