#include "paper_table.hpp"

#include <fmt/format.h>
#include <malloc.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cmath>
#include <ctime>
#include <functional>
#include <limits>
#include <stdexcept>

#include "found_tubes.hpp"
#include "markdown.hpp"
#include "paper_transcription.hpp"
#include "scan_bodies.hpp"
#include "tubetrack/replay/scan_surfels.hpp"
#include "tubetrack/report/score.hpp"

namespace tubetrack::bench {

namespace {

double processor_s() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

double peak_memory_mb() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) * 1024.0 / 1e6;
}

/// The median of five runs, as a scan takes little longer than what disturbs it; of one run where it takes long.
double median_s(const std::function<void()>& work) {
  constexpr double kLong_s = 1.0;
  constexpr std::size_t kRuns = 5;
  std::vector<double> seconds;
  while (seconds.size() < kRuns && (seconds.empty() || seconds.front() < kLong_s)) {
    const double begin_s = processor_s();
    work();
    seconds.push_back(processor_s() - begin_s);
  }
  return median(seconds);
}

/// Algorithm 1 on all faces, algorithm 2 both ways from its best voxel. accRadius is a tenth above the radius, which
/// the paper's method is told.
double transcription_s(std::span<const ScanSurfel> surfels, double radius_m, double cell_m) {
  const double begin_s = processor_s();
  std::vector<VoteRecord> records;
  records.reserve(surfels.size());
  const double acc_radius_m = 1.1 * radius_m;
  for (const ScanSurfel& of_scan : surfels) {
    Surfel surfel{of_scan.position_m, of_scan.inward_normal, of_scan.weight};
    surfel.radius_min_m = 0.0F;
    surfel.radius_max_m = static_cast<float>(acc_radius_m);
    records.push_back(vote_record(surfel, cell_m));
  }
  const paper::Images images = paper::accumulation_from_normal_vectors(records, 3);
  paper::TrackSettings settings;
  settings.cell_m = cell_m;
  settings.acc_radius_m = acc_radius_m;
  settings.track_step_m = radius_m;
  settings.dir = [&](const VoxelIndex& at) { return images.dir(at); };
  settings.max_points = 1'000'000;
  for (const bool in_front : {true, false}) paper::track_patch_center(images, images.max_pt, in_front, settings);
  return processor_s() - begin_s;
}

std::string ratio(double of, double to, int digits) {
  return to > 0.0 && std::isfinite(of) ? fmt::format("{:.{}f}", of / to, digits) : "–";
}

}  // namespace

PaperRow measure(const PaperScan& scan, bool with_transcription) {
  PaperRow row;
  row.name = scan.name;
  row.paper_s = scan.paper_s;
  row.goal_voxels = scan.goal_voxels;
  std::vector<ScanSurfel> surfels = surfels_of(scan.scan);
  // First, on fresh memory, as in a program of its own: on memory that is used again it takes longer.
  row.transcription_s =
      with_transcription ? transcription_s(surfels, scan.radius_m, 0.001) : std::numeric_limits<double>::quiet_NaN();
  malloc_trim(0);  // what it freed is put together again now, not by what asks for memory next
  TubeFrame frame;
  row.ours_s = median_s([&] {
    surfels = {};  // or there would be two at once
    surfels = surfels_of(scan.scan);
    frame = found_tubes(scan.scan, surfels);
  });
  row.peak_memory_mb = peak_memory_mb();
  row.faces = faces_of(scan.scan, surfels.size());
  row.tubes = frame.tubes.size();
  row.rms_voxels = std::numeric_limits<double>::quiet_NaN();
  if (!frame.tubes.empty()) {
    // A voxel is the grid step of the scan's making, of which the radius is a round number.
    row.rms_voxels = error_of(frame.tubes.front().centerline_m, scan.truth).rms_m / 0.001;
    for (const Tube& tube : frame.tubes) row.found += tube.length_m / length_of(scan.truth);
  }
  return row;
}

PaperRow measure_alone(std::size_t faces) {
  using Answer = std::array<double, 6>;
  Answer figures{};
  std::array<int, 2> ends{};
  if (pipe(ends.data()) != 0) throw std::runtime_error("no pipe to a process of its own");
  const pid_t process = fork();
  if (process == 0) {
    const PaperRow row = measure(mesh_of_faces(faces), false);
    figures = {static_cast<double>(row.faces),
               static_cast<double>(row.tubes),
               row.ours_s,
               row.rms_voxels,
               row.found,
               row.peak_memory_mb};
    _exit(write(ends[1], figures.data(), sizeof(Answer)) == sizeof(Answer) ? 0 : 1);
  }
  close(ends[1]);
  const bool whole = process > 0 && read(ends[0], figures.data(), sizeof(Answer)) == sizeof(Answer);
  close(ends[0]);
  if (process > 0) waitpid(process, nullptr, 0);
  if (!whole) throw std::runtime_error(fmt::format("the process that measures {} faces failed", faces));
  PaperRow row;
  row.faces = static_cast<std::size_t>(figures[0]);
  row.tubes = static_cast<std::size_t>(figures[1]);
  row.ours_s = figures[2], row.rms_voxels = figures[3], row.found = figures[4], row.peak_memory_mb = figures[5];
  return row;
}

std::string paper_rows_text(const std::vector<PaperRow>& rows) {
  MarkdownTable table({"scan", "faces", "paper, s", "transcription here, s", "ours, s", "transcription over ours",
                       "ours over the paper", "RMS to truth, voxels", "goal", "tubes", "length found"});
  for (const PaperRow& row : rows) {
    const bool quick = row.transcription_s >= 100.0 * row.ours_s || row.ours_s <= 0.01 * row.paper_s;
    table.add({row.name, std::to_string(row.faces), number(row.paper_s, 2), number(row.transcription_s, 2),
               number(row.ours_s, 3) + (quick ? " ✓" : " ✗"), ratio(row.transcription_s, row.ours_s, 1),
               ratio(row.ours_s, row.paper_s, 3), at_most(row.rms_voxels, row.goal_voxels, 1.0, 3),
               fmt::format("≤ {:g}", row.goal_voxels), std::to_string(row.tubes), number(row.found, 3)});
  }
  return table.text();
}

std::string robustness_text(const std::vector<PaperRow>& rows) {
  MarkdownTable table({"scan", "faces", "ours, s", "RMS to truth, voxels", "goal", "tubes", "length found"});
  for (const PaperRow& row : rows) {
    table.add({row.name, std::to_string(row.faces), number(row.ours_s, 3),
               at_most(row.rms_voxels, row.goal_voxels, 1.0, 3), fmt::format("≤ {:g}", row.goal_voxels),
               std::to_string(row.tubes), number(row.found, 3)});
  }
  return table.text();
}

std::string growth_text(const std::vector<PaperRow>& rows) {
  MarkdownTable table(
      {"faces", "ours, s", "µs a face", "peak memory, MB", "RMS to truth, voxels", "tubes", "length found"});
  double n = 0.0, sx = 0.0, sy = 0.0, sxx = 0.0, sxy = 0.0;
  for (const PaperRow& row : rows) {
    const auto faces = static_cast<double>(row.faces);
    table.add({std::to_string(row.faces), number(row.ours_s, 3), number(1e6 * row.ours_s / faces, 2),
               number(row.peak_memory_mb, 0), number(row.rms_voxels, 3), std::to_string(row.tubes),
               number(row.found, 3)});
    const double x = std::log(faces), y = std::log(row.ours_s);
    n += 1.0, sx += x, sy += y, sxx += x * x, sxy += x * y;
  }
  const double exponent = (n * sxy - sx * sy) / (n * sxx - sx * sx);
  return table.text() + fmt::format("\nThe time grows with the faces to the power of {} (goal: 0.9 to 1.1).\n",
                                    between(exponent, 0.9, 1.1, 1.0, 2));
}

}  // namespace tubetrack::bench
