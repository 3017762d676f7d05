// A live run at ten times the speed, with faults at random: it must neither grow, nor hang, nor lose a frame uncounted.
// TUBETRACK_SOAK_S: how long, in seconds; scripts/long takes 2880, eight hours of a device's time.
// TUBETRACK_SOAK_FAULT: in place of faults at random this one, like "unplug 0.1", every 60 frames; "none": none. Prints
// its figures.
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>
#include <sstream>

#include "apps/live_device.hpp"
#include "tubetrack/replay/recorder.hpp"

namespace tubetrack {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr double kSpeed = 10.0;

double soak_s() {
  const char* text = std::getenv("TUBETRACK_SOAK_S");
  return text == nullptr ? 6.0 : std::atof(text);
}

/// Resident memory in MB; 0 where the process is gone.
double memory_mb(pid_t pid) {
  std::ifstream in("/proc/" + std::to_string(pid) + "/statm");
  double pages = 0.0;
  in >> pages >> pages;
  return pages * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1e6;
}

std::int64_t entries(pid_t pid, const char* folder) {
  std::error_code error;
  std::int64_t count = 0;
  for (fs::directory_iterator entry("/proc/" + std::to_string(pid) + "/" + folder, error), end; !error && entry != end;
       entry.increment(error)) {
    ++count;
  }
  return count;
}

class Soak : public test::LiveTest {
 protected:
  /// A tube before a wall, 160×120, moving a little from frame to frame.
  fs::path small_scene() const {
    StreamInfo info;
    info.intrinsics = {160, 120, 150.0, 150.0, 79.5, 59.5, {}};
    info.metres_per_unit = 0.0001;
    const fs::path path = folder_ / "small";
    auto recorder = Recorder::create(path, info);
    EXPECT_TRUE(recorder);
    for (int i = 0; i < 90; ++i) {
      const double shift_m = 0.02 * std::sin(i * 2.0 * 3.14159265358979 / 90.0);
      std::vector<std::uint16_t> pixels;
      for (int v = 0; v < 120; ++v) {
        for (int u = 0; u < 160; ++u) {
          // The ray (x, ·, 1) z meets a cylinder of radius 30 mm about the line x = shift, z = 0.5 m.
          const double x = (u - 79.5) / 150.0;
          const double a = x * x + 1.0;
          const double b = x * shift_m + 0.5;
          const double root = b * b - a * (shift_m * shift_m + 0.25 - 0.0009);
          const bool tube = root > 0.0 && v > 10 && v < 110;
          pixels.push_back(static_cast<std::uint16_t>(std::lround((tube ? (b - std::sqrt(root)) / a : 0.8) * 1e4)));
        }
      }
      DepthFrame frame;
      frame.pixels = pixels.data();
      frame.width = 160;
      frame.height = 120;
      frame.stride_bytes = 320;
      frame.metres_per_unit = info.metres_per_unit;
      frame.timestamp_s = 10.0 + i / 30.0;
      EXPECT_TRUE(recorder->write(frame));
    }
    return path;
  }

  static std::string faults(double seconds) {
    const char* only = std::getenv("TUBETRACK_SOAK_FAULT");
    if (!only) return random_faults(seconds);
    std::ostringstream script;
    for (int frame = 60; only != std::string("none") && frame < seconds * 30.0 * kSpeed; frame += 60)
      script << frame << ' ' << only << '\n';
    return script.str();
  }

  /// Faults for `seconds` at ten times the speed, one after some hundred frames each.
  static std::string random_faults(double seconds) {
    std::mt19937 random(5);
    const auto pick = [&](int from, int to) { return std::uniform_int_distribution<int>(from, to)(random); };
    std::ostringstream script;
    std::int64_t frame = 100;
    for (; static_cast<double>(frame) < seconds * 30.0 * kSpeed; frame += pick(50, 600)) {
      script << frame << ' ';
      switch (pick(0, 6)) {
        case 0:
          script << "stall " << pick(1, 60) / 10.0;
          break;
        case 1:
          script << "unplug " << pick(1, 10) / 10.0;
          break;
        case 2:
          script << "time -" << pick(1, 50) / 10.0;
          break;
        case 3:
          script << "clock -" << pick(1, 1000);
          break;
        case 4:
          script << "burst " << pick(2, 40);
          break;
        case 5:
          script << "drop " << pick(1, 20);
          break;
        default:
          script << "cut " << pick(1, 3);
          break;
      }
      script << '\n';
    }
    return script.str();
  }
};

std::int64_t count_faults(const std::string& script) {
  return std::count(script.begin(), script.end(), '\n');
}

TEST_F(Soak, NothingGrowsNothingHangsAndEveryFrameIsThereOrCounted) {
  const fs::path scene = small_scene();
  const std::string script = faults(soak_s());
  play_on_its_own(std::to_string(kSpeed), script);
  setenv("TUBETRACK_VIRTUAL_DEVICE", scene.c_str(), 1);
  const pid_t pid = start({"live", "--silence", "2", "--no-timing", "--status-every", "60", "--out", lines()}, folder_);
  double early_mb = 0.0;
  double late_mb = 0.0;
  std::int64_t early_files = 0;
  std::int64_t early_threads = 0;
  std::int64_t late_files = 0;
  std::int64_t late_threads = 0;
  const auto began = std::chrono::steady_clock::now();
  std::uintmax_t written = 0;
  auto last_growth = began;
  for (double passed_s = 0.0; passed_s < soak_s();) {
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    const auto now = std::chrono::steady_clock::now();
    passed_s = std::chrono::duration<double>(now - began).count();
    ASSERT_EQ(waitpid(pid, nullptr, WNOHANG), 0) << "it ended by itself: " << errors();
    std::error_code ignored;
    const std::uintmax_t size = fs::file_size(lines(), ignored);
    if (!ignored && size != written) last_growth = now;
    written = size;
    ASSERT_LT(now - last_growth, std::chrono::seconds(20)) << "no line for so long";
    const bool early = passed_s < 0.4 * soak_s();
    (early ? early_mb : late_mb) = std::max(early ? early_mb : late_mb, memory_mb(pid));
    (early ? early_files : late_files) = std::max(early ? early_files : late_files, entries(pid, "fd"));
    (early ? early_threads : late_threads) = std::max(early ? early_threads : late_threads, entries(pid, "task"));
  }
  kill(pid, SIGINT);
  EXPECT_EQ(wait(pid), 0) << errors();
  EXPECT_LE(late_mb, early_mb * 1.05 + 2.0);
  EXPECT_LE(late_files, early_files + 1);
  EXPECT_LE(late_threads, early_threads + 1);
  std::int64_t frames = 0;
  std::int64_t corrupt = 0;
  json last;
  std::ifstream in(lines());
  for (std::string line; std::getline(in, line); ++frames) {
    corrupt += line.find(R"("status":"corrupt")") != std::string::npos ? 1 : 0;
    if (in.peek() == std::ifstream::traits_type::eof()) last = json::parse(line);
  }
  ASSERT_GT(frames, 0);
  const std::int64_t uncounted = last["frame"].get<std::int64_t>() + 1 - frames - last["dropped"].get<std::int64_t>();
  // Frames newer than the last line may be dropped, and counted, before it is written.
  EXPECT_LE(uncounted, 0);
  EXPECT_GE(uncounted, -30);
  EXPECT_LE(corrupt, 3 * count_faults(script)) << "a fault spoils three frames at the most";
  const std::string said = errors();
  const std::size_t totals = said.rfind("\nframes ");
  std::printf(
      "soak: %.0f s at %gx: memory %.1f MB then %.1f MB, files %lld then %lld, threads %lld then %lld\n%s\n", soak_s(),
      kSpeed, early_mb, late_mb, static_cast<long long>(early_files), static_cast<long long>(late_files),
      static_cast<long long>(early_threads), static_cast<long long>(late_threads),
      totals == std::string::npos ? "" : said.substr(totals + 1, said.find('\n', totals + 1) - totals - 1).c_str());
}

}  // namespace
}  // namespace tubetrack
