#include "src/receiver.hpp"

#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <time.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <limits>
#include <random>

namespace fiducap::sdk {

namespace {

// Datagrams that are read before a due request is sent.
constexpr int kDatagramsPerTurn = 256;
// Requests without a reply before the next address of the host, or a new look-up, is tried.
constexpr int kQuestionsPerAddress = 6;
// Larger values mean that the frames have the time line of a recording.
constexpr double kPlausibleLatency_s = 10.0;

Nanoseconds retry_of(const ClientOptions& options) {
  const double wanted_s = std::isfinite(options.reconnect_s) ? options.reconnect_s : 0.5;
  return static_cast<Nanoseconds>(std::clamp(wanted_s, 0.05, 60.0) * 1e9);
}

std::uint64_t random_word() {
  std::random_device device;
  return std::uint64_t{device()} << 32 | device();
}

/// Blocks the application's signals in this thread.
class SignalsBlocked {
 public:
  SignalsBlocked() {
    sigset_t all;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before_);
  }
  ~SignalsBlocked() { pthread_sigmask(SIG_SETMASK, &before_, nullptr); }
  SignalsBlocked(const SignalsBlocked&) = delete;
  SignalsBlocked& operator=(const SignalsBlocked&) = delete;

 private:
  sigset_t before_{};
};

}  // namespace

Nanoseconds monotonic_now() {
  timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  return now.tv_sec * kSecond + now.tv_nsec;
}

Receiver::Receiver(const ClientOptions& options)
    : where_(options.server + ":" + std::to_string(options.port)),
      retry_(retry_of(options)),
      wake_(std::make_shared<Wake>()),
      addresses_(options.server, options.port, wake_),
      conversation_(retry_, random_word(), options.name, profile_of(options), options.multicast),
      clock_(random_word()) {
  set_problem("no reply yet");
  const SignalsBlocked blocked;
  thread_ = std::thread([this] { run(); });
}

Receiver::~Receiver() {
  stopping_.store(true);
  wake_->ring();
  thread_.join();
}

bool Receiver::wait_for_frame(std::uint64_t after_number, std::chrono::milliseconds timeout) const {
  std::unique_lock<std::mutex> lock(mutex_);
  return newer_frame_.wait_for(lock, timeout, [&] {
    const bool before_restart =
        after_number > newest_number_ && after_number <= highest_before_restart_;
    return newest_number_ > after_number || before_restart;
  });
}

void Receiver::on_frame(std::function<void(const Frame&)> callback) {
  using Callback = const std::function<void(const Frame&)>;
  auto shared = callback ? std::make_shared<Callback>(std::move(callback)) : nullptr;
  const std::lock_guard<std::mutex> lock(mutex_);
  frame_callback_.swap(shared);
}

void Receiver::on_connection(std::function<void(bool)> callback) {
  using Callback = const std::function<void(bool)>;
  auto shared = callback ? std::make_shared<Callback>(std::move(callback)) : nullptr;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    connection_callback_.swap(shared);
  }
  connection_callback_is_new_.store(true);
  wake_->ring();
}

ClientStatistics Receiver::statistics() const {
  std::unique_lock<std::mutex> lock(mutex_);
  ClientStatistics statistics = counters_;
  const ReceiveStatistics received = received_;
  lock.unlock();
  statistics.rate_hz = received.rate_hz(monotonic_now());
  statistics.latency_p50_s = received.latency_quantile_s(0.50);
  statistics.latency_p99_s = received.latency_quantile_s(0.99);
  statistics.latency_max_s = received.latency_max_s();
  return statistics;
}

void Receiver::run() {
  ::pthread_setname_np(::pthread_self(), "fiducap-client");
  while (!stopping_.load()) {
    const Nanoseconds now = monotonic_now();
    open_socket(now);
    if (socket_.is_open()) {
      conversation_.tick(now);
      report_connection();
      if (conversation_.due(now)) ask(now);
    }
    if (socket_.is_open() && conversation_.leased()) {
      judge_multicast(now);
      if (now >= clock_.due_at()) ask_the_time(now);
    }
    wait(monotonic_now());
    read_datagrams();
    read_group();
  }
  if (socket_.is_open() && conversation_.leased())
    socket_.send(encode_unsubscribe(conversation_.token()));
}

void Receiver::open_socket(Nanoseconds now) {
  if (socket_.is_open() || now < open_at_) return;
  Address address;
  std::string problem;
  const auto state = addresses_.next(address, problem);
  if (state == AddressBook::State::kReady) problem = socket_.open(address);
  if (!problem.empty()) {
    set_problem(where_ + ": " + problem);
    open_at_ = addresses_.exhausted() ? now + retry_ : now;
  }
  if (socket_.is_open()) conversation_.start(now);
  if (state == AddressBook::State::kLooking) open_at_ = std::numeric_limits<Nanoseconds>::max();
}

void Receiver::give_up_address(Nanoseconds now) {
  drops_of_closed_sockets_ += socket_.dropped();
  socket_.close();
  drops_of_closed_sockets_ += group_.is_open() ? group_.dropped() : 0;
  group_.close();
  open_at_ = addresses_.exhausted() ? now + retry_ : now;
}

void Receiver::ask(Nanoseconds now) {
  if (conversation_.unanswered() >= kQuestionsPerAddress) {
    give_up_address(now);
    return;
  }
  const bool same_run =
      conversation_.session() == session_;  // else names and numbers are those of an ended server
  auto question = conversation_.question(same_run ? assembler_.model_generation() : 0, now);
  question.frames_received = assembler_.received();
  question.frames_lost = assembler_.lost();
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    const double p99_s = received_.latency_quantile_s(0.99);
    if (p99_s > 0) question.latency_p99 = static_cast<Nanoseconds>(p99_s * 1e9);
    question.clock_offset = counters_.clock.offset_ns;
    if (counters_.clock.known) {
      question.clock_sigma = 1 + static_cast<Nanoseconds>(counters_.clock.sigma_s * 1e9);
    }
  }
  if (socket_.send(encode(question)) == UdpSocket::Result::kRefused) {
    conversation_.refused(now);
    report_connection();
    give_up_address(now);
  }
}

void Receiver::ask_the_time(Nanoseconds now) {
  const std::uint64_t number = clock_.ask(now);
  // A query that cannot be sent is like a lost one: the next one follows.
  socket_.send(encode_clock_query(conversation_.token(), number));
}

void Receiver::judge_multicast(Nanoseconds now) {
  // Frames are sent to the group since the lease; switches may need a second to forward them.
  constexpr Nanoseconds kGroupTimeout = 2 * kSecond;
  if (!group_.is_open() || group_is_alive_ || now - group_since_ < kGroupTimeout) return;
  conversation_.give_up_multicast(now);
}

void Receiver::wait(Nanoseconds now) {
  Nanoseconds until = socket_.is_open() ? conversation_.wake_at() : open_at_;
  if (socket_.is_open() && conversation_.leased()) until = std::min(until, clock_.due_at());
  const Nanoseconds pause = std::clamp<Nanoseconds>(until - now, 0, kSecond);
  const timespec timeout{pause / kSecond, pause % kSecond};
  std::array<pollfd, 3> wanted{{{wake_->descriptor(), POLLIN, 0},
                                {socket_.descriptor(), POLLIN, 0},
                                {group_.descriptor(), POLLIN, 0}}};
  if (::ppoll(wanted.data(), wanted.size(), &timeout, nullptr) > 0 && wanted[0].revents != 0) {
    wake_->drain();
    open_at_ = std::min(open_at_, now);  // a look-up has ended
  }
}

void Receiver::read_datagrams() {
  std::array<std::uint8_t, kMaxDatagram + 1> bytes;  // one more, to detect longer datagrams
  for (int i = 0; i < kDatagramsPerTurn && socket_.is_open(); ++i) {
    std::size_t size = bytes.size();
    const auto result = socket_.receive(bytes.data(), size);
    if (result == UdpSocket::Result::kNothing) return;
    const Nanoseconds now = monotonic_now();
    if (result == UdpSocket::Result::kRefused) {
      conversation_.refused(now);
      give_up_address(now);
    } else {
      take(bytes.data(), size, now);
    }
    report_connection();
  }
}

void Receiver::read_group() {
  std::array<std::uint8_t, kMaxDatagram + 1> bytes;
  for (int i = 0; i < kDatagramsPerTurn && group_.is_open(); ++i) {
    std::size_t size = bytes.size();
    if (!group_.receive(bytes.data(), size)) return;
    // Any host can join and send to the group: only frames are accepted from it.
    if (decoder_.decode(bytes.data(), size) == MessageKind::kFrame)
      take_frame(monotonic_now(), true);
  }
}

void Receiver::take(const std::uint8_t* bytes, std::size_t size, Nanoseconds now) {
  switch (decoder_.decode(bytes, size)) {
    case MessageKind::kChallenge:
      return conversation_.on(decoder_.challenge(), now);
    case MessageKind::kNotice:
      return conversation_.on(decoder_.notice(), now);
    case MessageKind::kLease:
      return take_lease(now);
    case MessageKind::kModel:
      if (decoder_.model().profile != conversation_.profile()) return;
      if (conversation_.heard(decoder_.model().session, now)) assembler_.add(decoder_.model());
      return;
    case MessageKind::kFrame:
      return take_frame(now, false);
    case MessageKind::kClockReply:
      if (!conversation_.heard(decoder_.clock_reply().session, now)) return;
      clock_.on(decoder_.clock_reply(), now);
      return report_clock(now);
    case MessageKind::kDiscoveryReply:
      return;
    case MessageKind::kNone:
      return;
  }
}

void Receiver::take_lease(Nanoseconds now) {
  if (!conversation_.on(decoder_.lease(), now)) return;
  const Lease& lease = decoder_.lease();
  follow_group(lease, now);
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    counters_.dropped_by_server = lease.frames_dropped;
    counters_.multicast = group_.is_open();
  }
  if (conversation_.session() == session_ && conversation_.profile() == profile_) return;
  session_ = conversation_.session();
  profile_ = conversation_.profile();
  lost_before_session_ += assembler_.lost();
  assembler_.begin(session_);
  clock_.start(now);
}

void Receiver::follow_group(const Lease& lease, Nanoseconds now) {
  if (lease.group_port == 0) {
    drops_of_closed_sockets_ += group_.is_open() ? group_.dropped() : 0;
    return group_.close();
  }
  if (group_.listens_to(lease.group, lease.group_port)) return;
  group_since_ = now;
  group_is_alive_ = false;
  if (!group_.open(lease.group, lease.group_port, socket_)) conversation_.give_up_multicast(now);
}

void Receiver::take_frame(Nanoseconds now, bool by_multicast) {
  if (decoder_.frame().profile != conversation_.profile()) return;
  if (!conversation_.heard(decoder_.frame().session, now)) return;
  group_is_alive_ = group_is_alive_ || by_multicast;
  if (Frame* frame = assembler_.add(decoder_.frame())) deliver(*frame, now);
}

void Receiver::report_clock(Nanoseconds now) {
  const ClockEstimate estimate = clock_.at(now, socket_.server_is_local());
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::lock_guard<std::mutex> lock(mutex_);
  counters_.clock = {estimate.known,
                     estimate.offset,
                     estimate.drift * 1e6,
                     estimate.known ? estimate.sigma_s : nan,
                     estimate.known ? estimate.bound_s : nan,
                     estimate.known ? estimate.round_trip_s : nan};
}

void Receiver::place_in_own_time(Frame& frame, Nanoseconds now) const {
  const ClockEstimate clock = clock_.at(now, socket_.server_is_local());
  frame.at_client_ns = 0;
  frame.clock_sigma_s = std::numeric_limits<double>::quiet_NaN();
  if (!clock.known && !socket_.server_is_local())
    return;  // before the first reply: both clocks are the same here
  const Nanoseconds at = frame.at_server_ns - clock.offset;
  if (std::abs(static_cast<double>(now - at)) * 1e-9 > kPlausibleLatency_s) return;
  frame.at_client_ns = at;
  frame.clock_sigma_s = clock.sigma_s;
}

void Receiver::deliver(Frame& frame, Nanoseconds now) {
  report_connection();  // the connection is reported before its first frame
  frame.received_ns = now;
  place_in_own_time(frame, now);
  const double latency_s = frame.at_client_ns != 0
                               ? static_cast<double>(now - frame.at_client_ns) * 1e-9
                               : std::numeric_limits<double>::quiet_NaN();
  const std::uint64_t number = frame.number;
  const Frame* published = latest_.publish(frame);
  std::shared_ptr<const std::function<void(const Frame&)>> callback;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    received_.add(now, latency_s);
    ++counters_.frames;
    if (number < newest_number_)
      highest_before_restart_ = std::max(highest_before_restart_, newest_number_);
    counters_.lost = lost_before_session_ + assembler_.lost();
    counters_.dropped_here =
        drops_of_closed_sockets_ + socket_.dropped() + (group_.is_open() ? group_.dropped() : 0);
    newest_number_ = number;
    callback = frame_callback_;
  }
  newer_frame_.notify_all();
  if (callback) (*callback)(published != nullptr ? *published : frame);
}

void Receiver::report_connection() {
  const bool connected = conversation_.leased() && assembler_.model_generation() != 0;
  if (!connected && socket_.is_open()) set_problem(where_ + ": " + conversation_.problem());
  const bool is_new =
      connection_callback_is_new_.load() && connection_callback_is_new_.exchange(false);
  const bool changed = connected != connected_;
  if (!changed && !(is_new && connected)) return;
  connected_ = connected;
  std::shared_ptr<const std::function<void(bool)>> callback;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    counters_.connected = connected;
    if (connected) counters_.problem.clear();
    if (changed && connected && was_connected_) ++counters_.reconnects;
    callback = connection_callback_;
  }
  was_connected_ = was_connected_ || connected;
  if (callback) (*callback)(connected);
}

void Receiver::set_problem(const std::string& problem) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (counters_.problem != problem) counters_.problem = problem;
}

}  // namespace fiducap::sdk
