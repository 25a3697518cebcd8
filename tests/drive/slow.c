// Slows the clock of a program, for tests on a machine that has other work: time passes at
// 1/SLOW of its speed. The world, the gateway and the recorder then have SLOW times the CPU.
//   cc -shared -fPIC -O2 -o slow.so slow.c -ldl
//   SLOW=4 LD_PRELOAD=./slow.so wheelarm drive …
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <linux/futex.h>
#include <poll.h>
#include <stdarg.h>
#include <stdlib.h>
#include <sys/epoll.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#define NANOS 1000000000LL

static long long factor(void) {
    static long long known;
    if (known == 0) {
        const char *text = getenv("SLOW");
        long long given = text ? atoll(text) : 1;
        known = given < 1 ? 1 : given;
    }
    return known;
}

static int slowed(clockid_t clock) {
    return clock == CLOCK_MONOTONIC || clock == CLOCK_MONOTONIC_RAW || clock == CLOCK_MONOTONIC_COARSE ||
           clock == CLOCK_BOOTTIME;
}

static long long nanos(const struct timespec *time) { return time->tv_sec * NANOS + time->tv_nsec; }

static struct timespec timespec_of(long long nanos) {
    return (struct timespec){.tv_sec = nanos / NANOS, .tv_nsec = nanos % NANOS};
}

static struct timespec longer(const struct timespec *time) { return timespec_of(nanos(time) * factor()); }

int clock_gettime(clockid_t clock, struct timespec *out) {
    static int (*real)(clockid_t, struct timespec *);
    if (!real) real = dlsym(RTLD_NEXT, "clock_gettime");
    int result = real(clock, out);
    if (result == 0 && slowed(clock)) *out = timespec_of(nanos(out) / factor());
    return result;
}

int clock_nanosleep(clockid_t clock, int flags, const struct timespec *request, struct timespec *rest) {
    static int (*real)(clockid_t, int, const struct timespec *, struct timespec *);
    if (!real) real = dlsym(RTLD_NEXT, "clock_nanosleep");
    // An absolute time of a clock that is not slowed stays.
    if ((flags & TIMER_ABSTIME) && !slowed(clock)) return real(clock, flags, request, rest);
    struct timespec real_request = longer(request);
    int result = real(clock, flags, &real_request, rest);
    if (result == EINTR && rest && !(flags & TIMER_ABSTIME)) *rest = timespec_of(nanos(rest) / factor());
    return result;
}

int nanosleep(const struct timespec *request, struct timespec *rest) {
    int result = clock_nanosleep(CLOCK_MONOTONIC, 0, request, rest);
    if (result == 0) return 0;
    errno = result;
    return -1;
}

int epoll_wait(int epoll, struct epoll_event *events, int most, int millis) {
    static int (*real)(int, struct epoll_event *, int, int);
    if (!real) real = dlsym(RTLD_NEXT, "epoll_wait");
    return real(epoll, events, most, millis > 0 ? (int)(millis * factor()) : millis);
}

int poll(struct pollfd *files, nfds_t count, int millis) {
    static int (*real)(struct pollfd *, nfds_t, int);
    if (!real) real = dlsym(RTLD_NEXT, "poll");
    return real(files, count, millis > 0 ? (int)(millis * factor()) : millis);
}

// Condition variables and parked threads of Rust wait by this system call.
long syscall(long number, ...) {
    static long (*real)(long, ...);
    if (!real) real = dlsym(RTLD_NEXT, "syscall");
    va_list list;
    va_start(list, number);
    long a[6];
    for (int i = 0; i < 6; i += 1) a[i] = va_arg(list, long);
    va_end(list);
    if (number == SYS_futex && a[3] != 0) {
        int operation = (int)a[1] & FUTEX_CMD_MASK;
        int is_real_time = (int)a[1] & FUTEX_CLOCK_REALTIME;
        if (operation == FUTEX_WAIT || (operation == FUTEX_WAIT_BITSET && !is_real_time)) {
            struct timespec wait = longer((const struct timespec *)a[3]);
            return real(number, a[0], a[1], a[2], &wait, a[4], a[5]);
        }
    }
    return real(number, a[0], a[1], a[2], a[3], a[4], a[5]);
}
