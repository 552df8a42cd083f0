#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <memory>
#include <mutex>
#include <new>
#include <vector>

/// Passing objects between threads without allocation or waiting.
namespace fiducap {

/// Shared objects that return to the pool when released, and keep the capacity of their vectors.
///
/// After warm-up `acquire` allocates nothing. Thread-safe. Objects may outlive the pool.
template <typename T>
class ObjectPool final {
 public:
  /// @return an object with the contents of its last use, to be overwritten
  [[nodiscard]] std::shared_ptr<T> acquire() {
    T* object = storage_->take_object();
    return std::shared_ptr<T>(object, Return{storage_}, BlockAllocator<T>{storage_});
  }

 private:
  struct Storage {
    std::mutex mutex;
    std::vector<std::unique_ptr<T>> objects;
    std::vector<void*> blocks;
    std::size_t block_size{0};

    ~Storage() {
      for (void* block : blocks) ::operator delete(block);
    }
    T* take_object() {
      {
        const std::lock_guard lock(mutex);
        if (!objects.empty()) {
          T* object = objects.back().release();
          objects.pop_back();
          return object;
        }
      }
      return new T();
    }
    void return_object(T* object) {
      const std::lock_guard lock(mutex);
      objects.emplace_back(object);
    }
    void* take_block(std::size_t size) {
      {
        const std::lock_guard lock(mutex);
        if (size == block_size && !blocks.empty()) {
          void* block = blocks.back();
          blocks.pop_back();
          return block;
        }
        block_size = size;
      }
      return ::operator new(size);
    }
    void return_block(void* block) {
      const std::lock_guard lock(mutex);
      blocks.push_back(block);
    }
  };

  struct Return {
    std::shared_ptr<Storage> storage;
    void operator()(T* object) const { storage->return_object(object); }
  };

  // The control block has one size per T: one list of equal blocks is enough.
  template <typename U>
  struct BlockAllocator {
    using value_type = U;
    std::shared_ptr<Storage> storage;
    explicit BlockAllocator(std::shared_ptr<Storage> s) : storage(std::move(s)) {}
    template <typename V>
    BlockAllocator(const BlockAllocator<V>& other)
        : storage(other.storage) {}  // NOLINT: allocator rebind
    U* allocate(std::size_t n) { return static_cast<U*>(storage->take_block(n * sizeof(U))); }
    void deallocate(U* p, std::size_t) { storage->return_block(p); }
    template <typename V>
    bool operator==(const BlockAllocator<V>& other) const {
      return storage == other.storage;
    }
  };

  std::shared_ptr<Storage> storage_{std::make_shared<Storage>()};
};

/// Passes the newest value from one thread to another without a lock; older ones are replaced.
///
/// Triple buffer: slots are swapped. Values keep their memory; only the writer destroys them.
template <typename T>
class NewestValue final {
 public:
  /// The writer's slot; holds an older value.
  [[nodiscard]] T& writing() { return slots_[writing_]; }
  /// Offers the written value to the reader. The writer's slot is another one afterwards.
  void offer() {
    writing_ = offered_.exchange(writing_ | kFresh, std::memory_order_acq_rel) & kSlot;
  }

  /// @return true: `reading()` has a new value
  [[nodiscard]] bool fetch() {
    if ((offered_.load(std::memory_order_acquire) & kFresh) == 0) return false;
    reading_ = offered_.exchange(reading_, std::memory_order_acq_rel) & kSlot;
    return true;
  }
  /// The reader's slot, until the next `fetch`.
  [[nodiscard]] T& reading() { return slots_[reading_]; }

 private:
  static constexpr unsigned kSlot = 3;
  static constexpr unsigned kFresh = 4;  // not fetched yet

  std::array<T, 3> slots_{};
  unsigned writing_{0};
  std::atomic<unsigned> offered_{1};
  unsigned reading_{2};
};

}  // namespace fiducap
