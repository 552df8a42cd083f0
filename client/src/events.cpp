#include "fiducap/events.hpp"

#include <algorithm>
#include <deque>
#include <thread>
#include <utility>

#include "src/message_stream.hpp"

namespace fiducap {

namespace {

using Steady = std::chrono::steady_clock;

constexpr std::chrono::seconds kReplyTimeout{5};  // for the rest of a message that has begun
constexpr std::chrono::milliseconds kConnectTimeout{500};  // at least
// The server sends a message at least every five seconds.
constexpr std::chrono::seconds kSilence{15};
constexpr std::chrono::milliseconds kReconnectPause{500};
constexpr std::size_t kMostWaiting = 4096;  // the oldest are dropped

ServerEvent to_event(const v1::ControlEvent& in) {
  ServerEvent out;
  out.number = in.number();
  out.at_utc_ms = static_cast<std::int64_t>(in.utc_ms());
  out.severity = in.severity() == v1::ControlEvent::SEVERITY_INFO      ? EventSeverity::kInfo
                 : in.severity() == v1::ControlEvent::SEVERITY_WARNING ? EventSeverity::kWarning
                                                                       : EventSeverity::kError;
  out.subject = in.subject();
  out.kind = in.kind();
  out.text = in.text();
  out.remedy = in.remedy();
  out.over = in.over();
  return out;
}

}  // namespace

class EventWatch::Impl {
 public:
  explicit Impl(EventOptions options)
      : options_(std::move(options)), wants_history_(options_.history) {}

  bool next(ServerEvent& event, std::chrono::milliseconds timeout) {
    const auto deadline = Steady::now() + timeout;
    while (waiting_.empty()) {
      if (is_ready(deadline)) receive();
      if (waiting_.empty() && Steady::now() >= deadline) return false;
    }
    event = std::move(waiting_.front());
    waiting_.pop_front();
    return true;
  }
  const std::vector<ServerEvent>& standing() const { return standing_; }
  const std::string& problem() const { return problem_; }

 private:
  /// @return true: there is something to read
  bool is_ready(Steady::time_point deadline) {
    auto& tcp = stream_.tcp();
    if (!tcp.is_open() && !connect(deadline)) return false;
    if (tcp.wait_for_more(std::min(deadline, heard_at_ + kSilence))) return true;
    if (Steady::now() >= heard_at_ + kSilence) lose("the server stopped replying");
    return false;
  }

  bool connect(Steady::time_point deadline) {
    const auto not_before = tried_at_ + kReconnectPause;
    if (not_before > deadline) {
      std::this_thread::sleep_until(deadline);
      return false;
    }
    std::this_thread::sleep_until(not_before);
    v1::ControlHello hello;
    const auto until = std::max(deadline, Steady::now() + kConnectTimeout);
    problem_ = stream_.open(options_.server, options_.port, until, hello);
    tried_at_ = heard_at_ = Steady::now();
    v1::ControlRequest request;
    request.set_sequence(1);
    request.mutable_watch_events()->set_after(known_);
    if (problem_.empty()) problem_ = stream_.write(request, until);
    if (!problem_.empty()) lose(problem_);
    return problem_.empty();
  }

  void receive() {
    v1::ControlReply reply;
    if (const auto why = stream_.read(reply, Steady::now() + kReplyTimeout); !why.empty())
      return lose(why);
    if (!reply.has_events())
      return lose(reply.text().empty() ? "the server has no events" : reply.text());
    heard_at_ = Steady::now();
    for (const auto& event : reply.events().happened()) {
      known_ = event.number();
      if (wants_history_) waiting_.push_back(to_event(event));
      if (waiting_.size() > kMostWaiting) waiting_.pop_front();
    }
    wants_history_ = true;  // later events are all new
    standing_.clear();
    for (const auto& event : reply.events().standing()) standing_.push_back(to_event(event));
  }

  void lose(std::string why) {
    stream_.tcp().close();
    standing_.clear();
    const std::string where = options_.server + ":" + std::to_string(options_.port) + ": ";
    problem_ = why.rfind(where, 0) == 0 ? std::move(why) : where + why;
  }

  EventOptions options_;
  bool wants_history_;
  sdk::MessageStream stream_;
  std::uint64_t known_{0};  ///< Number of the newest event.
  Steady::time_point tried_at_{};
  Steady::time_point heard_at_{};
  std::deque<ServerEvent> waiting_;
  std::vector<ServerEvent> standing_;
  std::string problem_;
};

EventWatch::EventWatch(EventOptions options) : impl_(std::make_unique<Impl>(std::move(options))) {}
EventWatch::~EventWatch() = default;

bool EventWatch::next(ServerEvent& event, std::chrono::milliseconds timeout) {
  return impl_->next(event, timeout);
}
const std::vector<ServerEvent>& EventWatch::standing() const { return impl_->standing(); }
const std::string& EventWatch::problem() const { return impl_->problem(); }

}  // namespace fiducap
