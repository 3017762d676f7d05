#include "bend_study.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "figures.hpp"
#include "found_tubes.hpp"
#include "markdown.hpp"
#include "random_tubes.hpp"
#include "scan_bodies.hpp"
#include "tubetrack/replay/scan_surfels.hpp"

namespace tubetrack::bench {

namespace {

constexpr double kNoiseRadii = 0.01;
constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kLength_m = 0.0001, kLengthPerMetre = 0.0002;

/// The rows of the same tube, followed from its other end; the turn between two planes is right-handed either way.
std::vector<BendRow> from_the_other_end(const std::vector<BendRow>& rows) {
  std::vector<BendRow> back;
  const std::size_t bends = rows.size() - 1;
  for (std::size_t i = 0; i <= bends; ++i) {
    BendRow row = i < bends ? rows[bends - 1 - i] : BendRow{};
    row.length_m = rows[bends - i].length_m;
    row.length_sigma_m = rows[bends - i].length_sigma_m;
    row.rotation_rad = i > 0 && i < bends ? rows[bends - i].rotation_rad : 0.0;
    row.rotation_sigma_rad = i > 0 && i < bends ? rows[bends - i].rotation_sigma_rad : 0.0;
    back.push_back(row);
  }
  return back;
}

BendDeviations deviations_of(const PartChain& truth, const std::vector<BendRow>& rows) {
  BendDeviations off;
  const std::size_t bends = truth.bends.size();
  for (std::size_t i = 0; i <= bends; ++i) {
    const BendRow& row = rows[i];
    const double length_m = i < bends ? truth.bends[i].straight_m : truth.closing_m;
    const Deviation length{row.length_m - length_m, row.length_sigma_m};
    (i == 0 || i == bends ? off.end_length : off.inner_length).push_back(length);
    off.length_excess.push_back(std::abs(length.error) / (kLength_m + kLengthPerMetre * length_m));
    if (i == bends) break;
    const ChainBend& bend = truth.bends[i];
    off.angle.push_back({row.angle_rad - bend.angle_rad, row.angle_sigma_rad});
    off.radius.push_back({row.bend_radius_m - bend.radius_m, row.bend_radius_sigma_m});
    off.radius_relative.push_back(std::abs(row.bend_radius_m / bend.radius_m - 1.0));
    if (i == 0) continue;
    off.rotation.push_back(
        {std::remainder(row.rotation_rad - bend.rotation_rad, 2.0 * std::numbers::pi), row.rotation_sigma_rad});
  }
  return off;
}

double sum_of(const BendDeviations& off) {
  double sum = 0.0;
  for (const Deviation& angle : off.angle) sum += std::abs(angle.error);
  for (const Deviation& rotation : off.rotation) sum += std::abs(rotation.error);
  for (const double radius : off.radius_relative) sum += radius;
  for (const double length : off.length_excess) sum += 0.01 * length;
  return sum;
}

template <class T>
void append(std::vector<T>& to, const std::vector<T>& from) {
  to.insert(to.end(), from.begin(), from.end());
}

void add(BendDeviations& sum, const BendDeviations& part) {
  append(sum.angle, part.angle);
  append(sum.radius, part.radius);
  append(sum.rotation, part.rotation);
  append(sum.inner_length, part.inner_length);
  append(sum.end_length, part.end_length);
  append(sum.radius_relative, part.radius_relative);
  append(sum.length_excess, part.length_excess);
}

std::string parts_of(const Tube& tube) {
  std::string text;
  for (const Segment& segment : tube.segments) {
    text += fmt::format(" {}{:.1f}",
                        segment.type == Segment::Type::straight ? 'S'
                        : segment.type == Segment::Type::arc    ? 'A'
                                                                : 'F',
                        (segment.to_m - segment.from_m) / tube.radius_m);
  }
  return text;
}

std::string parts_of(const RandomTube& tube) {
  std::string text;
  for (const ChainBend& bend : tube.chain.bends) {
    text += fmt::format(" S{:.1f} A{:.1f}({:.0f} deg, {:.1f} R, turned {:.0f})", bend.straight_m / tube.radius_m,
                        bend.radius_m * bend.angle_rad / tube.radius_m, bend.angle_rad / kDegree,
                        bend.radius_m / tube.radius_m, bend.rotation_rad / kDegree);
  }
  return text + fmt::format(" S{:.1f}", tube.chain.closing_m / tube.radius_m);
}

}  // namespace

bool add_deviations(const PartChain& truth, const BendTable& table, BendDeviations& sum) {
  if (table.lra.size() != truth.bends.size() + 1) return false;
  const BendDeviations there = deviations_of(truth, table.lra);
  const BendDeviations back = deviations_of(truth, from_the_other_end(table.lra));
  add(sum, sum_of(there) <= sum_of(back) ? there : back);
  return true;
}

Scan scan_of_random_tube(std::uint64_t seed, bool one_side) {
  const RandomTube tube = random_tube(seed);
  ScanOfTube how{tube.radius_m, tube.step_m};
  how.seen_from = tube.seen_from;
  how.noise_m = kNoiseRadii * tube.radius_m;
  how.one_side = one_side;
  std::mt19937_64 random(seed);
  return mesh_of_tube(tube.chain, how, random);
}

BendStudy study_bends(std::uint64_t first_seed, int tubes, bool one_side) {
  BendStudy study;
  for (int i = 0; i < tubes; ++i) {
    const std::uint64_t seed = first_seed + static_cast<std::uint64_t>(i);
    const RandomTube truth = random_tube(seed);
    const Scan scan = scan_of_random_tube(seed, one_side);
    const TubeFrame frame = found_tubes(scan, surfels_of(scan));
    ++study.tubes;
    if (frame.tubes.size() == 1 && add_deviations(truth.chain, frame.tubes.front().bend_table, study.deviations)) {
      ++study.right;
      continue;
    }
    study.wrong.push_back(fmt::format("seed {}: {} tube(s)", seed, frame.tubes.size()));
    for (const Tube& tube : frame.tubes) study.wrong.back() += " |" + parts_of(tube);
    study.wrong.back() += "; true" + parts_of(truth);
  }
  return study;
}

double median_error(const std::vector<Deviation>& deviations) {
  std::vector<double> errors;
  errors.reserve(deviations.size());
  for (const Deviation& deviation : deviations) errors.push_back(std::abs(deviation.error));
  return quantile(errors, 0.5);
}

double part_inside(const std::vector<Deviation>& deviations) {
  const auto inside = std::count_if(deviations.begin(), deviations.end(), [](const Deviation& deviation) {
    return std::abs(deviation.error) <= 1.959964 * deviation.sigma;
  });
  return static_cast<double>(inside) / static_cast<double>(deviations.size());
}

std::string bend_table_text(const BendStudy& full, const BendStudy& one_side) {
  MarkdownTable table({"figure", "goal", "full scans", "goal", "from one side"});
  const auto row = [&](const char* figure, auto value, double goal, double unit, int digits, const char* shown) {
    table.add({figure, fmt::format("≤ {:g}{}", goal / unit, shown), at_most(value(full.deviations), goal, unit, digits),
               fmt::format("≤ {:g}{}", 2.0 * goal / unit, shown),
               at_most(value(one_side.deviations), 2.0 * goal, unit, digits)});
  };
  const auto right = [](const BendStudy& study) { return static_cast<double>(study.right) / study.tubes; };
  table.add({"number of bends right", "≥ 98 %", at_least(right(full), 0.98, 0.01, 1), "≥ 96 %",
             at_least(right(one_side), 0.96, 0.01, 1)});
  row(
      "bend angle, median", [](const BendDeviations& d) { return median_error(d.angle); }, 0.1 * kDegree, kDegree, 4,
      "°");
  row(
      "bend radius, median", [](const BendDeviations& d) { return quantile(d.radius_relative, 0.5); }, 0.01, 0.01, 3,
      " %");
  row(
      "rotation, median", [](const BendDeviations& d) { return median_error(d.rotation); }, 0.2 * kDegree, kDegree, 4,
      "°");
  row(
      "length over 0.1 mm + 0.2 mm a metre, median",
      [](const BendDeviations& d) { return quantile(d.length_excess, 0.5); }, 1.0, 1.0, 2, "");
  const auto plain = [&](const char* figure, auto value, double unit, int digits) {
    table.add({figure, "–", number(value(full.deviations) / unit, digits), "–",
               number(value(one_side.deviations) / unit, digits)});
  };
  plain(
      "straights between bends, median, mm", [](const BendDeviations& d) { return median_error(d.inner_length); },
      0.001, 4);
  plain(
      "straights at the ends, median, mm", [](const BendDeviations& d) { return median_error(d.end_length); }, 0.001,
      4);
  const auto interval = [&](const char* figure, auto of) {
    table.add({figure, "93–97 %", between(part_inside(of(full.deviations)), 0.93, 0.97, 0.01, 1), "93–97 %",
               between(part_inside(of(one_side.deviations)), 0.93, 0.97, 0.01, 1)});
  };
  interval("angle inside its 95 % interval", [](const BendDeviations& d) { return d.angle; });
  interval("bend radius inside", [](const BendDeviations& d) { return d.radius; });
  interval("rotation inside", [](const BendDeviations& d) { return d.rotation; });
  interval("straight between bends inside", [](const BendDeviations& d) { return d.inner_length; });
  interval("straight at an end inside", [](const BendDeviations& d) { return d.end_length; });
  return table.text();
}

}  // namespace tubetrack::bench
