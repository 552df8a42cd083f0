#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "src/address_book.hpp"
#include "src/clock_sync.hpp"
#include "src/codec.hpp"
#include "src/conversation.hpp"
#include "src/frame_assembler.hpp"
#include "src/group_socket.hpp"
#include "src/latest_frame.hpp"
#include "src/receive_statistics.hpp"
#include "src/udp_socket.hpp"
#include "src/wake.hpp"

namespace fiducap::sdk {

/// CLOCK_MONOTONIC, the clock of a server on the same machine.
Nanoseconds monotonic_now();

/// The thread of a client: maintains the subscription, decodes datagrams, notifies waiting callers.
class Receiver {
 public:
  explicit Receiver(const ClientOptions& options);
  /// Unsubscribes and ends the thread.
  ~Receiver();
  Receiver(const Receiver&) = delete;
  Receiver& operator=(const Receiver&) = delete;

  const LatestFrame& latest() const { return latest_; }
  bool wait_for_frame(std::uint64_t after_number, std::chrono::milliseconds timeout) const;
  void on_frame(std::function<void(const Frame&)> callback);
  void on_connection(std::function<void(bool)> callback);
  ClientStatistics statistics() const;

 private:
  void run();
  void open_socket(Nanoseconds now);
  void give_up_address(Nanoseconds now);
  void ask(Nanoseconds now);
  void ask_the_time(Nanoseconds now);
  void judge_multicast(Nanoseconds now);
  void wait(Nanoseconds now);
  void read_datagrams();
  void read_group();
  void take(const std::uint8_t* bytes, std::size_t size, Nanoseconds now);
  void take_lease(Nanoseconds now);
  void follow_group(const Lease& lease, Nanoseconds now);
  void report_clock(Nanoseconds now);
  void take_frame(Nanoseconds now, bool by_multicast);
  void place_in_own_time(Frame& frame, Nanoseconds now) const;
  void deliver(Frame& frame, Nanoseconds now);
  void report_connection();
  void set_problem(const std::string& problem);

  std::string where_;  ///< `host:port`, for messages.
  Nanoseconds retry_;
  std::shared_ptr<Wake> wake_;
  AddressBook addresses_;
  std::atomic<bool> stopping_{false};
  std::atomic<bool> connection_callback_is_new_{false};

  // Used by the thread only.
  UdpSocket socket_;
  Nanoseconds open_at_{0};
  Conversation conversation_;
  ClockSync clock_;
  GroupSocket group_;
  Nanoseconds group_since_{0};  ///< Begin of receiving from it.
  bool group_is_alive_{false};  ///< A frame has arrived by it.
  Decoder decoder_;
  FrameAssembler assembler_;
  std::uint64_t session_{0};
  std::uint32_t profile_{0};  ///< Number of the accepted frames.
  bool connected_{false};
  bool was_connected_{false};
  std::uint64_t lost_before_session_{0};
  std::uint64_t drops_of_closed_sockets_{0};

  LatestFrame latest_;

  mutable std::mutex
      mutex_;  ///< Protects the rest; never held while sending, receiving or in callbacks.
  mutable std::condition_variable newer_frame_;
  std::uint64_t newest_number_{0};
  std::uint64_t highest_before_restart_{0};
  ReceiveStatistics received_;
  ClientStatistics counters_;
  std::shared_ptr<const std::function<void(const Frame&)>> frame_callback_;
  std::shared_ptr<const std::function<void(bool)>> connection_callback_;

  std::thread thread_;  ///< Last, so that it starts after all members exist.
};

}  // namespace fiducap::sdk
