"""Long work as an object: iterated or run, and stopped in one way."""

import _thread
import signal
import threading

import pytest

from vqa_state.study.progress_bar import Position
from vqa_state.study.run import Run, never, on_interrupt


class Counting:
    """Counts to a number unless it is stopped; remembers whether it was closed."""

    def __init__(self, total=5, at=lambda number: None):
        self.total, self.at, self.closed = total, at, False

    def __call__(self, stop):
        try:
            for number in range(self.total):
                self.at(number)
                yield number
                if stop():
                    return
        finally:
            self.closed = True


def run_of(work, stop=never):
    return Run("counting", work, lambda number: Position(number, work.total), stop)


def test_it_gives_the_reports_of_its_work():
    assert list(run_of(Counting())) == [0, 1, 2, 3, 4]


def test_nothing_happens_before_it_is_iterated():
    work = Counting(at=lambda number: pytest.fail("it began"))
    run = run_of(work)
    assert not run.stopped
    assert "run()" in repr(run)


def test_run_gives_the_last_report_and_writes_nothing_where_nobody_looks(capsys):
    assert run_of(Counting()).run() == 4
    assert capsys.readouterr() == ("", "")


def test_it_can_be_begun_once():
    run = run_of(Counting())
    list(run)
    with pytest.raises(RuntimeError, match="begun already; make another"):
        run.run()
    with pytest.raises(RuntimeError, match="begun already"):
        iter(run)


def test_stop_in_a_loop_ends_it_with_its_last_report():
    run, seen = run_of(Counting()), []
    for number in run:
        seen.append(number)
        if number == 2:
            run.stop()
    assert seen == [0, 1, 2]
    assert run.stopped


def test_stop_from_another_thread():
    holder = []

    def at(number):
        if number == 1:
            thread = threading.Thread(target=holder[0].stop)
            thread.start()
            thread.join()

    holder.append(run_of(Counting(at=at)))
    assert holder[0].run() == 1


def test_a_function_that_is_given_stops_it_too():
    assert run_of(Counting(), stop=lambda: True).run() == 0


def test_leaving_the_loop_closes_the_work():
    work = Counting()
    for _ in run_of(work):
        break
    assert work.closed


def test_the_first_interrupt_stops_and_the_last_report_comes():
    before = signal.getsignal(signal.SIGINT)
    work = Counting(at=lambda number: number == 2 and signal.raise_signal(signal.SIGINT))
    run = run_of(work)
    assert run.run() == 2
    assert run.stopped
    assert signal.getsignal(signal.SIGINT) is before


def test_the_second_interrupt_ends_at_once():
    before = signal.getsignal(signal.SIGINT)

    def at(number):
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)

    work = Counting(at=at)
    with pytest.raises(KeyboardInterrupt):
        run_of(work).run()
    assert work.closed
    assert signal.getsignal(signal.SIGINT) is before


def test_an_error_of_the_work_comes_through_and_the_signal_is_put_back():
    before = signal.getsignal(signal.SIGINT)

    def at(number):
        raise ValueError("no")

    with pytest.raises(ValueError, match="no"):
        run_of(Counting(at=at)).run()
    assert signal.getsignal(signal.SIGINT) is before


def test_it_runs_outside_the_main_thread_where_no_signal_can_be_caught():
    found = []
    thread = threading.Thread(target=lambda: found.append(run_of(Counting()).run()))
    thread.start()
    thread.join()
    assert found == [4]


def test_an_interrupt_from_another_thread_is_heard():
    heard = []
    with on_interrupt(lambda: heard.append(True)):
        _thread.interrupt_main()
        for _ in range(1000):  # the signal is handled between two bytecodes
            if heard:
                break
    assert heard == [True]
