#include "tubetrack/heightmap/workers.hpp"

namespace tubetrack {

Workers::Workers(int count) {
  threads_.reserve(static_cast<std::size_t>(count - 1));
  for (int i = 1; i < count; ++i) threads_.emplace_back([this, i] { serve(i); });
}

Workers::~Workers() {
  work_ = nullptr;
  ++round_;
  round_.notify_all();
}

void Workers::run_on_all(const void* work, Call call) {
  work_ = work;
  call_ = call;
  busy_ = static_cast<int>(threads_.size());
  ++round_;
  round_.notify_all();
  call(work, 0);
  for (int busy = busy_; busy != 0; busy = busy_) busy_.wait(busy);
}

void Workers::serve(int i) {
  for (std::uint32_t round = 0;; ++round) {
    round_.wait(round);
    if (!work_) return;
    call_(work_, i);
    if (--busy_ == 0) busy_.notify_one();
  }
}

}  // namespace tubetrack
