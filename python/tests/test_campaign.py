"""Campaigns in parts: the same bits as on one machine."""

import pickle
from concurrent.futures import ProcessPoolExecutor

import pytest
from test_sensor import LOG, Log

import navfuse


@pytest.fixture(scope="module")
def campaign(short):
    scenario = short.with_sensors(Log).set(LOG).set("estimator.stop", "65 s")
    return scenario.set("sensor.log", {"simulation": {"rate": "1 Hz"}}).campaign(5, seed=3)


@pytest.fixture(scope="module")
def whole(campaign, tmp_path_factory):
    """The campaign on one machine: its report, and its files."""
    folder = tmp_path_factory.mktemp("whole")
    report = campaign.scenario.monte_carlo(5, seed=3, out=folder)
    return report, files(folder)


def files(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir() if not path.name.startswith(".")}


def test_parts_in_other_processes_merge_to_the_bits_of_one_machine(campaign, whole, tmp_path):
    with ProcessPoolExecutor(2) as pool:
        parts = list(pool.map(navfuse.Shard.run, campaign.shards(3)))
    assert navfuse.merge(reversed(parts), out=tmp_path) == whole[0]
    assert files(tmp_path) == whole[1]


def test_dask_runs_the_parts(campaign, whole):
    distributed = pytest.importorskip("distributed")
    with distributed.Client(n_workers=2, threads_per_worker=1, dashboard_address=None) as client:
        parts = client.gather(client.map(navfuse.Shard.run, campaign.shards(3)))
    assert navfuse.merge(parts) == whole[0]


def test_ray_runs_the_parts(campaign, whole):
    ray = pytest.importorskip("ray")
    ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False)
    try:
        run = ray.remote(navfuse.Shard.run)
        parts = ray.get([run.remote(shard) for shard in campaign.shards(3)])
    finally:
        ray.shutdown()
    assert navfuse.merge(parts) == whole[0]


def test_parts_that_are_missing_or_of_another_campaign_are_rejected(campaign, short):
    first, second = (shard.run() for shard in campaign.shards(2))
    with pytest.raises(navfuse.NavfuseError, match="part 2/2 is missing"):
        navfuse.merge([first])
    other = campaign.scenario.campaign(5, seed=4).shards(2)[1].run()
    with pytest.raises(navfuse.NavfuseError, match="seed"):
        navfuse.merge([first, other])
    with pytest.raises(ValueError, match="one is the least"):
        campaign.shards(0)
    with pytest.raises(TypeError, match="in memory"):
        pickle.dumps(short.with_samples([]))
