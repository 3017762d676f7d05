#include "speed_page.hpp"

#include <fmt/format.h>

#include <iterator>

#include "figures.hpp"
#include "markdown.hpp"

namespace tubetrack::bench {

namespace {

constexpr const char* kHowMeasured = R"(## How it is measured

Scenes are made and rendered before anything is timed (`bench/speed/speed_scenes.cpp`): frames with noise of their own,
kept in memory and played forth and back at 30 frames a second. What moves swings, so that it jumps nowhere. The tracker
has its default configuration, one thread, no radius. Times (but with two threads) are processor time of that thread around the whole call, so
that what other programs take is not in them (that they disturb the caches is); on an idle machine the wall's clock runs
alike. The stages are by the tracker's own clock, on the wall. Every row begins with a pass over its frames that is not counted.

All that stands in one row was timed in turns: each gets frame *i* before any gets frame *i* + 1, and who is first
changes from frame to frame. A machine that is slow for a while is so for all of them, and the ratios stay.

- **floor pass**: converts the frame to metres and takes the mean of 7 × 7 pixels around each, in plain code on one
  thread (`bench/speed/floor_pass.cpp`). Whatever looks at all pixels costs as much.
- **FALS**: OpenCV's `RgbdNormals`, window 7, one thread; the points it needs are made before and not counted.
- **tubes reported** is the mean over frames: what is quick because it finds nothing shows here.
- **pixels on tubes**: those with a return that see a tube at less than 75°, which the fit may use; by the scene's exact
  geometry.
- **cells that change**: those of the height map that restart, gain or lose their reading in a frame.
)";

constexpr const char* kNextFactor =
    R"(What profiles of these scenes show, and what was not tried yet; docs/open.md has what was.

- **still**: a third is to read the frame in, which memory bounds more than arithmetic (leaving stores out and reading
  ahead changed nothing), half to predict, choose and fit the tube's pixels. Next: fit a tube that is at rest to every
  second row and column, as its place is pooled over frames anyway.
- **moving tube**: nearly half is surfels, though of the tiles that changed half are looked at in a frame, a quarter to
  follow the tube, a sixth to read the frame in. Next: fewer cells, by marking columns 8 px apart in place of 16; no
  surfels where a known tube explains all; the first placing with every other row.
- **moving camera**: all is new in every frame, so two fifths of the rows are searched in one. Next: records that move
  with the poses, so that only what comes into view is new.
- **first frames**: most of a tube is traced before it is grown, but some rounds predict and fit all of it until nothing
  moves, neighbours are fitted again without each other's pixels, and surfels, votes and the frame itself alone take
  a third. Next: what docs/open.md names.
- **fit for 1,000 pixels**: its goal is 30 ns a pixel, in which each is predicted once or twice, compared, chosen
  and summed into the normal equations, and evidence is gathered. Next: fewer pixels, as above; each second one costs
  σ · √2 where noise is what limits.
- **4.5 floor passes**: where the goal was set a floor pass took 0.64 ms, so they were 2.9 ms. Here the compiler
  vectorises it, and it takes less. OpenCV's FALS took 2.4 ms there: how long it takes here, below, says how this machine
  compares.
)";

std::string head(const SpeedReport& report, const SpeedAbout& about) {
  std::string peers;
  for (const PeerTimes& peer : report.peers) peers += (peers.empty() ? "" : "; ") + peer.name;
  return fmt::format(
      "# How fast tubetrack is\n\nWritten by `{}`; don't edit.\n\n"
      "| | |\n| --- | --- |\n| commit | {} |\n| compiler | {} |\n| CPU | {} |\n| peers | {} |\n\n",
      about.command, about.commit, compiler(), about.cpu,
      peers.empty() ? "not run (scripts/bench runs them)" : "OpenCV FALS; " + peers);
}

std::string scene_list(const SpeedReport& report) {
  std::string text;
  for (const SpeedRow& row : report.scenes) text += fmt::format("- **{}**: {}\n", row.name, row.shows);
  return text;
}

}  // namespace

std::string speed_page(const SpeedReport& report, const SpeedAbout& about) {
  std::string text = head(report, about);
  const auto section = [&](const char* title, const std::string& before, const std::string& table) {
    fmt::format_to(std::back_inserter(text), "## {}\n\n{}{}{}\n", title, before, before.empty() ? "" : "\n", table);
  };
  section("The goals", "✓ and ✗ say whether a figure meets its goal.\n", speed_goals(report, about.peak_memory_mb));
  section("The scenes", "640 × 480 pixels, one thread.\n\n" + scene_list(report), scenes_table(report));
  section("Where the time goes",
          "Medians of each stage, in milliseconds on the wall; they don't add up to the frame's median. *rest* is what "
          "the call "
          "takes beside its stages.\n",
          stages_table(report));
  section(
      "The first frame",
      "A fresh tracker for each frame, which looks for tubes of radius 5 to 100 mm in all of it. Stages as above.\n",
      first_table(report));
  section("What the next factor would need", kNextFactor, "");
  section("Peers",
          "On the frames of the moving tube, in turns with tubetrack; the slow ones get one frame in some. The tube "
          "has two straights and an "
          "arc between them; PCL and CGAL find straight pieces.\n",
          rivals_table(report));
  section("Size of the image", "The moving tube; the field of view across is the same.\n", growth_table(report.sizes));
  section("Number of tubes", "Radius 12 mm, side by side, all swinging.\n", growth_table(report.counts));
  section(
      "Volume",
      "The moving tube with cells of 3 mm, while the depth in which tubes are looked for, and with it the volume in "
      "view that the accumulation map could hold, grows. All three in turns on the same frames.\n",
      growth_table(report.volumes));
  section("Two threads",
          "`--threads 2` beside one thread, and the floor pass in two bands beside one, all on the wall and in turns. "
          "Two cores that do nothing else are needed for this to say much.\n",
          threads_table(report.threads));
  section("Cells that change",
          fmt::format("The still scene, and a board behind the tube that jumps by 60 mm from frame to frame and covers "
                      "from none to half of the image. Above the first row the time grows with the cells that change "
                      "to the power of {}.\n",
                      number(changes_exponent(report.changes), 2)),
          changes_table(report.changes));
  return text + kHowMeasured +
         fmt::format(
             "- a row ends after {:g} s (with PCL and CGAL: twice that) even where not all of its frames were timed; "
             "p99 stands where 1,000 or more "
             "were.\n",
             report.options.row_seconds);
}

}  // namespace tubetrack::bench
