#include "race.hpp"

#include <time.h>

#include <chrono>

#include "speed_scenes.hpp"

namespace tubetrack::bench {

double thread_ms() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

double wall_ms() {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

std::vector<std::vector<double>> race(const std::vector<RenderedFrame>& frames,
                                      const std::vector<Contender>& contenders, int warm_up, int count,
                                      double most_seconds, double (*clock_ms)()) {
  using Clock = std::chrono::steady_clock;
  auto begin = Clock::now();
  std::vector<std::vector<double>> times_ms(contenders.size());
  for (int i = 0; i < warm_up + count; ++i) {
    if (i == warm_up) begin = Clock::now();
    if (i > warm_up && Clock::now() - begin > std::chrono::duration<double>(most_seconds)) break;
    const DepthFrame frame = played_frame(frames, i);
    for (std::size_t j = 0; j < contenders.size(); ++j) {
      const std::size_t turn = (j + static_cast<std::size_t>(i)) % contenders.size();
      const Contender& contender = contenders[turn];
      if (i % contender.every != 0) continue;
      if (contender.prepare) contender.prepare(frame);
      const double start_ms = clock_ms();
      contender.run(frame);
      const double end_ms = clock_ms();
      if (i >= warm_up) times_ms[turn].push_back(end_ms - start_ms);
    }
  }
  return times_ms;
}

}  // namespace tubetrack::bench
